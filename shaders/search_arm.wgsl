// Begins the search of each configuration in contact: a workspace whose words are zero, the joints' axes, and the list
// of unfinished configurations; one invocation a configuration.

override WORKGROUP: u32 = 64u;

@group(0) @binding(0) var<uniform> parameters: SearchParameters;
// See kinematics.wgsl.
@group(0) @binding(1) var<storage, read> chain: array<real>;
@group(0) @binding(2) var<storage, read> motions: array<vec2<real>>;
@group(0) @binding(3) var<storage, read> list: array<u32>;
@group(0) @binding(4) var<storage, read_write> words: array<u32>;
@group(0) @binding(5) var<storage, read_write> reals: array<vec4<real>>;

fn chain_vector(at: u32) -> vec3<real> {
    return vec3<real>(chain[at], chain[at + 1u], chain[at + 2u]);
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let place = unfold(group, groups) * WORKGROUP + local;
    if place >= parameters.configurations {
        return;
    }
    words[place] = place;
    words[2u * parameters.room] = parameters.configurations;
    take_place(place);
    member = list[parameters.first + place];
    set_word(MEMBER, member);
    // At rest nothing has moved.
    set_scalar(MOVED, real(0.0));
    set_scalar(BULGE, parameters.bulge);
    set_scalar(TRIAL_ELASTIC, real(0.0));
    set_scalar(STIFFNESS, parameters.first_kc);
    // Columns of the link's rotation, and its origin.
    var x = vec3<real>(1.0, 0.0, 0.0);
    var y = vec3<real>(0.0, 1.0, 0.0);
    var z = vec3<real>(0.0, 0.0, 1.0);
    var origin = vec3<real>(0.0);
    for (var k = 0u; k < parameters.joints; k += 1u) {
        let o = chain_vector(7u * k);
        let a = chain_vector(7u * k + 3u);
        let kind = chain[7u * k + 6u];
        let motion = motions[member * parameters.joints + k];
        origin += o.x * x + o.y * y + o.z * z;
        let axis = a.x * x + a.y * y + a.z * z;
        set_vector(at_joint(k), origin);
        set_scalar(at_joint(k) + SLIDES, kind);
        set_vector(at_joint(k) + AXIS, axis);
        if kind == 0.0 {
            x = turn(axis, motion, x);
            y = turn(axis, motion, y);
            z = turn(axis, motion, z);
        } else {
            origin += motion.x * axis;
        }
    }
}
