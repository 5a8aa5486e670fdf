// Rotations in f64.

// Rodrigues: v turned about the unit vector `axis` by the angle with the given cosine and sine.
fn turn(axis: vec3<f64>, motion: vec2<f64>, v: vec3<f64>) -> vec3<f64> {
    return motion.x * v + motion.y * cross(axis, v) + ((1.0 - motion.x) * dot(axis, v)) * axis;
}
