//! The data of object and proxy that contact needs, computed once and shared by all threads.

use super::geometry::{RestSurface, smooth::SmoothSurface};
use super::law::rounded::Rounded;
use super::linear::condensed::Condensed;
use crate::contact::geometry::LENGTH_ROUNDING;
use crate::object::{Compliance, Object};
use crate::proxy::Chain;
use crate::scene::{ContactLaw, ContactSpec};
use std::sync::Arc;

/// Stiffness of a rigid contact point, in units of the stiffness of the object's softest node (one over the trace of
/// its compliance) (1): force and torque differ from those of perfectly rigid contact by the inverse of this.
const RIGID_STIFFNESS: f64 = 1e6;

/// An object and a proxy, prepared for contact. A clone shares what is large.
#[derive(Clone)]
pub struct Model<'a> {
    /// The object.
    pub object: &'a Object,
    /// The proxy.
    pub chain: &'a Chain,
    /// C = K^-1 on the surface nodes that can be reached; changed by [`Model::take_compliance`] alone.
    pub compliance: Arc<Compliance>,
    /// How equation (2) is solved; its stiffness is finite.
    pub contact: ContactSpec,
    /// Stiffness kc = 3 Kc at a contact point of the energy form: three springs Kc on the nodes of a triangle act along
    /// the normal like one spring of this stiffness at the contact point. Finite for rigid contact too:
    /// `RIGID_STIFFNESS` (N/m).
    pub kc: f64,
    /// Stiffness of each proxy node's spring over kc, in the laws; the paper's iteration has springs all alike: more
    /// than one where the node stands for more than the mean length of link, see [`ContactSpec::node_stiffness`] (1).
    pub shares: Vec<f64>,
    /// Whether each equilibrium comes with its tangent d tau/d q.
    pub with_tangent: bool,
    /// Whether each equilibrium in contact comes with its slip, on which friction acts.
    pub with_slip: bool,
    /// The surface at rest.
    pub surface: Arc<RestSurface<'a>>,
    /// The same rounded, where contact is with that.
    pub(crate) rounded: Option<Arc<Rounded>>,
    /// The compliance on the points of its lattice, and those on which it is asked for.
    pub(crate) condensed: Arc<Condensed>,
    wanted: Arc<Vec<bool>>,
    /// Largest trace of a covered node's own block C_jj: no node moves farther than sqrt(max_nodal_compliance) times
    /// |u| in the energy norm (m/N).
    pub max_nodal_compliance: f64,
    /// Largest eigenvalue of a covered node's own block C_jj, or a bound of it: no node moves farther than
    /// sqrt(mobility) times |u| in the energy norm (m/N).
    pub mobility: f64,
    /// The same for what facets stand off the flat triangles by, where contact is with a smooth surface (m/N).
    pub(crate) bulge_mobility: f64,
    /// Whether the compliance covers all nodes of the facets of a leaf (leaves of the surface's tree).
    pub(super) covered_leaves: Arc<Vec<bool>>,
}

/// How far a displaced surface is from the surface at rest.
#[derive(Clone, Copy, Debug, Default)]
pub struct MotionBound {
    /// No point of the surface has moved farther (m).
    pub moved: f64,
    /// No facet stands off its flat triangle by more (m).
    pub bulge: f64,
}

impl<'a> Model<'a> {
    /// Prepares `object` and `chain` for contact as `contact` says, wherever it may be.
    #[must_use]
    pub fn new(object: &'a Object, chain: &'a Chain, contact: ContactSpec) -> Self {
        let mut model = Self::with_compliance(object, chain, contact, Compliance::new(object).into());
        model.want_all();
        model
    }

    /// Surface nodes up to which all of the compliance is formed: at most 0.3 GB, in some seconds.
    pub const WHOLE: usize = 2048;

    pub(super) fn with_compliance(
        object: &'a Object,
        chain: &'a Chain,
        contact: ContactSpec,
        compliance: Arc<Compliance>,
    ) -> Self {
        let surface = Arc::new(RestSurface::new(object, contact.surface));
        let mut model = Self {
            object,
            chain,
            rounded: rounded(&surface, chain, contact),
            condensed: Arc::default(),
            wanted: Arc::default(),
            max_nodal_compliance: 0.0,
            mobility: 0.0,
            bulge_mobility: 0.0,
            covered_leaves: Arc::default(),
            compliance,
            contact,
            kc: 0.0,
            shares: chain.nodes.iter().map(|node| contact.share(node.length)).collect(),
            with_tangent: false,
            with_slip: false,
            surface,
        };
        model.measure_compliance();
        model
    }

    /// Takes `compliance` instead of what there is, with all that follows from it.
    pub fn take_compliance(&mut self, compliance: Arc<Compliance>) {
        self.compliance = compliance;
        self.measure_compliance();
        self.condense();
    }

    /// Condenses the compliance on all points of a rounded surface that may be touched.
    pub(super) fn want_all(&mut self) {
        if let Some(rounded) = &self.rounded {
            self.want(rounded.near(greatest_radius(self.chain)));
        }
    }

    /// Condenses the compliance on the points of a rounded surface that are `wanted`.
    pub(super) fn want(&mut self, wanted: Vec<bool>) {
        self.wanted = Arc::new(wanted);
        self.condense();
    }

    fn condense(&mut self) {
        if let Some(rounded) = self.rounded.as_ref().filter(|_| !self.wanted.is_empty()) {
            self.condensed =
                Arc::new(Condensed::new(&rounded.rows, |l| rounded.sources(l), &self.wanted, &self.compliance));
        }
    }

    /// Takes from the compliance how far the surface moves, and how stiff rigid contact is.
    fn measure_compliance(&mut self) {
        (self.max_nodal_compliance, self.mobility) = max_nodal_compliance(&self.compliance);
        self.bulge_mobility =
            self.surface.smooth.as_ref().map_or(0.0, |smooth| bulge_mobility(smooth, &self.compliance));
        self.covered_leaves = Arc::new(covered_leaves(&self.surface, &self.compliance));
        self.set_stiffness(self.contact.stiffness);
    }

    /// The same object and proxy in contact as `contact` says.
    #[must_use]
    pub fn with_contact(&self, contact: ContactSpec) -> Self {
        let shares = self.chain.nodes.iter().map(|node| contact.share(node.length)).collect();
        let mut model = Self { contact, shares, ..self.clone() };
        if contact.surface != self.contact.surface {
            model.surface = Arc::new(RestSurface::new(self.object, contact.surface));
        }
        if (contact.surface, contact.law, contact.round) != (self.contact.surface, self.contact.law, self.contact.round)
        {
            model.rounded = rounded(&model.surface, self.chain, contact);
            model.want_all();
        }
        model.measure_compliance();
        model
    }

    /// Takes another contact stiffness Kc; infinity is rigid (N/m).
    pub fn set_stiffness(&mut self, stiffness: f64) {
        self.contact.stiffness =
            if stiffness.is_infinite() { RIGID_STIFFNESS / (3.0 * self.max_nodal_compliance) } else { stiffness };
        self.kc = 3.0 * self.contact.stiffness;
    }

    /// Returns how far the surface can be from where it rests when the object stores the energy `elastic` (J): for any
    /// sum g of the nodes' displacements |g . u|^2 <= |g . C g| |u|^2, the last in the energy norm.
    #[must_use]
    pub fn motion_bound(&self, elastic: f64) -> MotionBound {
        let norm = (2.0 * elastic.max(0.0)).sqrt() * (1.0 + LENGTH_ROUNDING);
        let bulging = self.bulge_mobility.sqrt() * norm;
        MotionBound { moved: self.mobility.sqrt() * norm + bulging, bulge: self.surface.bulge + bulging }
    }
}

/// `surface` rounded for `chain` as `contact` says, if it says so.
fn rounded(surface: &RestSurface<'_>, chain: &Chain, contact: ContactSpec) -> Option<Arc<Rounded>> {
    let spacing = contact.round.filter(|_| contact.law == ContactLaw::Rest)?;
    Some(Arc::new(Rounded::new(surface, spacing, greatest_radius(chain))))
}

/// The greatest radius of a node of `chain` (m).
pub(super) fn greatest_radius(chain: &Chain) -> f64 {
    chain.nodes.iter().map(|node| node.radius).fold(0.0, f64::max)
}

/// The greatest g . C g over what facets stand off their flat triangles by, as a sum g of nodes' displacements: a bound
/// of its largest eigenvalue. Nodes that are not covered do not move (m/N).
fn bulge_mobility(smooth: &SmoothSurface, compliance: &Compliance) -> f64 {
    smooth.bulge_squared(|terms| {
        let places = terms
            .iter()
            .filter(|(_, weight)| *weight != 0.0)
            .filter_map(|(node, weight)| Some((compliance.place(*node)?, *weight)));
        let places: Vec<(usize, f64)> = places.collect();
        let mut sum = 0.0;
        for &(i, weight) in &places {
            for &(j, other) in &places {
                let block = compliance.block(i, j);
                let trace = block.x_axis.x + block.y_axis.y + block.z_axis.z;
                sum += weight * other * if compliance.rows_per_node == 1 { trace / 3.0 } else { trace };
            }
        }
        sum
    })
}

/// Largest trace of a node's own block, and a bound of its largest eigenvalue: that of an isotropic object's block is a
/// third of its trace (m/N).
fn max_nodal_compliance(compliance: &Compliance) -> (f64, f64) {
    let trace = |j: usize| {
        let own = compliance.block(j, j);
        own.x_axis.x + own.y_axis.y + own.z_axis.z
    };
    let max_nodal_compliance = (0..compliance.nodes.len()).map(trace).fold(0.0, f64::max);
    (
        max_nodal_compliance,
        if compliance.rows_per_node == 1 { max_nodal_compliance / 3.0 } else { max_nodal_compliance },
    )
}

/// Returns whether `compliance` covers all nodes of the facets of each leaf of the tree of `surface`.
fn covered_leaves(surface: &RestSurface<'_>, compliance: &Compliance) -> Vec<bool> {
    let covered = |t: &u32| surface.carriers(*t).0.iter().all(|&node| compliance.place(node).is_some());
    surface.bounds.leaves.iter().map(|leaf| leaf.triangles.iter().all(covered)).collect()
}
