// Links, nodes, arrows and axes: instances of one rounded cone between two ends, each end with its radius. A sphere is
// a cone of no length, an arrow's head one with a radius of zero at its tip.

// Displacements of the object's nodes: shapes that are anchored to one go with it.
@group(0) @binding(1) var<storage, read> state: array<vec4<f32>>;

struct Instance {
    // End and its radius [m].
    @location(0) tail: vec4<f32>,
    @location(1) head: vec4<f32>,
    // Red, green, blue, and how much of it takes light: 0 for markings that keep their colour.
    @location(2) colour: vec4<f32>,
    // One more than the node of the object that it is anchored to; 0 for none.
    @location(4) anchor: u32,
}

struct Corner {
    @builtin(position) clip: vec4<f32>,
    @location(0) position: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) colour: vec4<f32>,
}

// A vertex of the unit shape: a point of the unit sphere, and which end it belongs to (0 tail, 1 head).
@vertex
fn vertex(@location(3) unit: vec4<f32>, instance: Instance) -> Corner {
    let span = instance.head.xyz - instance.tail.xyz;
    let length_squared = dot(span, span);
    var along = vec3<f32>(0.0, 0.0, 1.0);
    if length_squared > LEAST_DIVISOR {
        along = span * inverseSqrt(length_squared);
    }
    var aside = vec3<f32>(1.0, 0.0, 0.0);
    if abs(along.x) > 0.8 {
        aside = vec3<f32>(0.0, 1.0, 0.0);
    }
    let across = normalize(cross(along, aside));
    let up = cross(along, across);
    let normal = unit.x * across + unit.y * up + unit.z * along;
    let end = mix(instance.tail, instance.head, unit.w);
    var position = end.xyz + end.w * normal;
    if instance.anchor > 0u {
        position += state[instance.anchor - 1u].xyz;
    }
    return Corner(view.clip * vec4<f32>(position, 1.0), position, normal, instance.colour);
}

@fragment
fn fragment(in: Corner) -> @location(0) vec4<f32> {
    let normal = normalize(in.normal);
    let shaded = lit(in.colour.rgb, normal, normalize(view.eye.xyz - in.position));
    return shown(mix(in.colour.rgb, shaded, in.colour.a));
}
