//! What contact needs to know of object and proxy, computed once and shared by all threads.

use super::{geometry::RestSurface, reach};
use crate::JointVector;
use crate::object::{Compliance, Object, ObjectError};
use crate::proxy::Chain;
use crate::scene::ContactSpec;
use crate::tolerances::{LENGTH_ROUNDING, RIGID_STIFFNESS};
use std::sync::Arc;

/// An object and a proxy, prepared for contact. A clone shares what is large.
#[derive(Clone)]
pub struct Model<'a> {
    /// The object.
    pub object: &'a Object,
    /// The proxy.
    pub chain: &'a Chain,
    /// C = K^-1 on the surface nodes that can be reached.
    pub compliance: Arc<Compliance>,
    /// How equation (2) is solved; its stiffness is finite.
    pub contact: ContactSpec,
    /// Stiffness kc = 3 Kc at a contact point of the energy form: three springs Kc on the nodes of a triangle act along the
    /// normal like one spring of this stiffness at the contact point. Finite for rigid contact too:
    /// [`RIGID_STIFFNESS`] [N/m].
    pub kc: f64,
    /// Stiffness of each proxy node's spring over kc, in the algorithms but `paper`, whose springs are all alike: more than one where the
    /// node stands for more than the mean length of link, see [`ContactSpec::node_stiffness`] [1].
    pub shares: Vec<f64>,
    /// Whether each equilibrium comes with its tangent d tau/d q.
    pub with_tangent: bool,
    /// The surface at rest.
    pub surface: Arc<RestSurface<'a>>,
    /// Largest trace of a covered node's own block C_jj: no node moves farther than sqrt(softest) times |u| in the energy norm [m/N].
    pub softest: f64,
    /// Largest eigenvalue of a covered node's own block C_jj, or a bound of it: no node moves farther than sqrt(mobility) times |u| in
    /// the energy norm [m/N].
    pub mobility: f64,
}

impl<'a> Model<'a> {
    /// Prepares `object` and `chain` for contact as `contact` says, wherever it may be.
    #[must_use]
    pub fn new(object: &'a Object, chain: &'a Chain, contact: ContactSpec) -> Self {
        Self::with_compliance(object, chain, contact, Compliance::new(object))
    }

    /// The same for contact at or near `configurations`: of an object with more than [`Model::WHOLE`] surface nodes, only the
    /// compliance of those within the proxy's reach is formed. A configuration that reaches farther is flagged
    /// [`super::Status::Overflow`].
    ///
    /// # Errors
    /// When the compliance would not fit in memory.
    pub fn reaching(
        object: &'a Object,
        chain: &'a Chain,
        contact: ContactSpec,
        configurations: &[JointVector],
    ) -> Result<Self, ObjectError> {
        if object.surface_nodes <= Self::WHOLE {
            return Ok(Self::new(object, chain, contact));
        }
        let mut model = Self::with_compliance(object, chain, contact, Compliance::on(object, Vec::new())?);
        model.compliance = Arc::new(Compliance::on(object, reach::reached(&model, configurations))?);
        (model.softest, model.mobility) = softest(&model.compliance);
        model.set_stiffness(contact.stiffness);
        Ok(model)
    }

    /// Surface nodes up to which all of the compliance is formed: at most 0.3 GB, in some seconds.
    pub const WHOLE: usize = 2048;

    fn with_compliance(object: &'a Object, chain: &'a Chain, contact: ContactSpec, compliance: Compliance) -> Self {
        let (softest, mobility) = softest(&compliance);
        let mut model = Self {
            object,
            chain,
            softest,
            mobility,
            compliance: Arc::new(compliance),
            contact,
            kc: 0.0,
            shares: chain.nodes.iter().map(|node| contact.share(node.length)).collect(),
            with_tangent: false,
            surface: Arc::new(RestSurface::new(object)),
        };
        model.set_stiffness(contact.stiffness);
        model
    }

    /// The same object and proxy in contact as `contact` says.
    #[must_use]
    pub fn with_contact(&self, contact: ContactSpec) -> Self {
        let shares = self.chain.nodes.iter().map(|node| contact.share(node.length)).collect();
        let mut model = Self { contact, shares, ..self.clone() };
        model.set_stiffness(contact.stiffness);
        model
    }

    /// Takes another contact stiffness Kc; infinity is rigid [N/m].
    pub fn set_stiffness(&mut self, stiffness: f64) {
        self.contact.stiffness =
            if stiffness.is_infinite() { RIGID_STIFFNESS / (3.0 * self.softest) } else { stiffness };
        self.kc = 3.0 * self.contact.stiffness;
    }

    /// How far any point of the surface can be from where it rests when the object stores the energy `elastic` [J]:
    /// |u_j|^2 <= |C_jj| |u|^2, the last in the energy norm [m].
    #[must_use]
    pub fn motion_bound(&self, elastic: f64) -> f64 {
        (2.0 * self.mobility * elastic.max(0.0)).sqrt() * (1.0 + LENGTH_ROUNDING)
    }
}

/// Largest trace of a node's own block, and a bound of its largest eigenvalue: that of an isotropic object's block is a third of its
/// trace [m/N].
fn softest(compliance: &Compliance) -> (f64, f64) {
    let trace = |j: usize| {
        let own = compliance.block(j, j);
        own.x_axis.x + own.y_axis.y + own.z_axis.z
    };
    let softest = (0..compliance.nodes.len()).map(trace).fold(0.0, f64::max);
    (softest, if compliance.rows_per_node == 1 { softest / 3.0 } else { softest })
}
