// What all drawing stages share: the view and the light. Colours are gamma-encoded, as the window takes them.

struct View {
    // World to clip space; from where the object is to where it is being moved.
    clip: mat4x4<f32>,
    object: mat4x4<f32>,
    eye: vec4<f32>,
    // Direction towards the key light, unit length.
    light: vec4<f32>,
    // The surface's colour map from its low to its high end, at even steps.
    stops: array<vec4<f32>, 5>,
    // Displacement [m] or contact force [N] at the top of the colour map; width of the drawn edges [pixels], 0 for
    // none.
    colour_top: f32,
    edge_width: f32,
    nodes: u32,
    triangles: u32,
    // 0: the surface is coloured by displacement, 1: by contact force.
    quantity: u32,
    // Colour that takes the place of all others, and how much of it: 1 in the shadow.
    shade: vec4<f32>,
}

@group(0) @binding(0) var<uniform> view: View;

// What a fragment of this colour shows.
fn shown(colour: vec3<f32>) -> vec4<f32> {
    return vec4<f32>(mix(colour, view.shade.rgb, view.shade.a), 1.0);
}

// Key light, fill from the opposite side, light from above, and a soft highlight.
fn lit(colour: vec3<f32>, normal: vec3<f32>, to_eye: vec3<f32>) -> vec3<f32> {
    // Seen from behind (a surface turned inside out), a surface still shows its shape.
    let facing = select(-normal, normal, dot(normal, to_eye) >= 0.0);
    let key = max(dot(facing, view.light.xyz), 0.0);
    let fill = max(dot(facing, -view.light.xyz), 0.0);
    let sky = 0.5 + 0.5 * facing.z;
    let gloss = pow(max(dot(facing, normalize(view.light.xyz + to_eye)), 0.0), 40.0);
    return colour * (0.34 + 0.22 * sky + 0.46 * key + 0.10 * fill) + vec3<f32>(0.10 * gloss);
}
