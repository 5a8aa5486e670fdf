// Rotations.

// Rodrigues: v turned about the unit vector `axis` by the angle with the given cosine and sine.
fn turn(axis: vec3<real>, motion: vec2<real>, v: vec3<real>) -> vec3<real> {
    return motion.x * v + motion.y * cross(axis, v) + ((1.0 - motion.x) * dot(axis, v)) * axis;
}
