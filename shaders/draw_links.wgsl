// Shapes of links: flat triangles, each with the frame that moves it.

// From each frame to the world: what stands still first, then the links.
@group(0) @binding(1) var<storage, read> frames: array<mat4x4<f32>>;

struct Corner {
    @builtin(position) clip: vec4<f32>,
    @location(0) position: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) colour: vec3<f32>,
}

@vertex
fn vertex(
    @location(0) place: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) frame: u32,
    @location(3) colour: vec3<f32>,
) -> Corner {
    let position = (frames[frame] * vec4<f32>(place, 1.0)).xyz;
    let turned = (frames[frame] * vec4<f32>(normal, 0.0)).xyz;
    return Corner(view.clip * vec4<f32>(position, 1.0), position, turned, colour);
}

@fragment
fn fragment(in: Corner) -> @location(0) vec4<f32> {
    let shaded = lit(in.colour, normalize(in.normal), normalize(view.eye.xyz - in.position));
    return shown(shaded);
}
