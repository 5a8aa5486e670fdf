// Where the arm is. No trigonometry: the host sends cosine and sine of every joint, or the displacement of a prismatic
// one.

// Rodrigues: v turned about the unit vector `axis` by the angle with the given cosine and sine.
fn turn(axis: vec3<f32>, motion: vec2<f32>, v: vec3<f32>) -> vec3<f32> {
    return motion.x * v + motion.y * cross(axis, v) + ((1.0 - motion.x) * dot(axis, v)) * axis;
}

fn chain_vector(at: u32) -> vec3<f32> {
    return vec3<f32>(chain[at], chain[at + 1u], chain[at + 2u]);
}

fn slides(joint: u32) -> bool {
    return chain[7u * joint + 6u] != 0.0;
}

// Place of the point `position` in the frame of link `links - 1`; of link -1 that is the world. From the tip inwards
// each joint moves the point from its link's frame into its parent's.
fn placed(configuration: u32, position: vec3<f32>, links: u32) -> vec3<f32> {
    var x = position;
    for (var k = links; k > 0u; k -= 1u) {
        let joint = k - 1u;
        let axis = chain_vector(7u * joint + 3u);
        let motion = motions[configuration * parameters.joints + joint];
        if slides(joint) {
            x += motion.x * axis;
        } else {
            x = turn(axis, motion, x);
        }
        x += chain_vector(7u * joint);
    }
    return x;
}

// The same of a direction.
fn turned(configuration: u32, direction: vec3<f32>, links: u32) -> vec3<f32> {
    var v = direction;
    for (var k = links; k > 0u; k -= 1u) {
        let joint = k - 1u;
        if !slides(joint) {
            v = turn(chain_vector(7u * joint + 3u), motions[configuration * parameters.joints + joint], v);
        }
    }
    return v;
}

fn at_proxy_node(node: u32) -> u32 {
    return 7u * parameters.joints + 6u * node;
}

fn link_of(node: u32) -> u32 {
    return u32(chain[at_proxy_node(node) + 3u]);
}

fn radius_of(node: u32) -> f32 {
    return chain[at_proxy_node(node) + 4u];
}

fn share_of(node: u32) -> f32 {
    return chain[at_proxy_node(node) + 5u];
}

fn node_at(configuration: u32, node: u32) -> vec3<f32> {
    return placed(configuration, chain_vector(at_proxy_node(node)), link_of(node) + 1u);
}

// Point of each joint's axis, and the axis.
var<workgroup> origins: array<vec3<f32>, JOINTS>;
var<workgroup> axes: array<vec3<f32>, JOINTS>;

// Places the joints. For all invocations together.
fn place_joints(configuration: u32, local: u32) {
    if local < parameters.joints {
        origins[local] = placed(configuration, chain_vector(7u * local), local);
        axes[local] = turned(configuration, chain_vector(7u * local + 3u), local);
    }
    workgroupBarrier();
}

// Velocity of proxy node `node` at x by joint k.
fn jacobian_column(node: u32, x: vec3<f32>, k: u32) -> vec3<f32> {
    if k > link_of(node) {
        return vec3<f32>(0.0);
    }
    return select(cross(axes[k], x - origins[k]), axes[k], slides(k));
}
