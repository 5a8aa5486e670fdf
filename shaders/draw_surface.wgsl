// The deforming surface, drawn straight from the buffers that the frame update writes: three vertices a triangle,
// pulled by number. The normal at a node is the area-weighted mean over the triangles around it, in the deformed state.

// Rest positions; w is unused.
@group(0) @binding(1) var<storage, read> rest: array<vec4<f32>>;
// Displacements of all nodes, then velocities.
@group(0) @binding(2) var<storage, read> state: array<vec4<f32>>;
// Contact force on each node [N].
@group(0) @binding(3) var<storage, read> forces: array<vec4<f32>>;
// Corners of the triangles; then, per surface node, where its list begins (one more than there are nodes); then, node
// by node, the triangles around it.
@group(0) @binding(4) var<storage, read> mesh: array<u32>;

struct Corner {
    @builtin(position) clip: vec4<f32>,
    @location(0) position: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) share: vec3<f32>,
    @location(3) quantity: f32,
}

fn deformed(node: u32) -> vec3<f32> {
    return rest[node].xyz + state[node].xyz;
}

fn area_vector(triangle: u32) -> vec3<f32> {
    let a = deformed(mesh[3u * triangle]);
    let b = deformed(mesh[3u * triangle + 1u]);
    let c = deformed(mesh[3u * triangle + 2u]);
    return cross(b - a, c - a);
}

fn node_normal(node: u32) -> vec3<f32> {
    let starts = 3u * view.triangles;
    let lists = starts + view.nodes + 1u;
    var sum = vec3<f32>(0.0);
    for (var k = mesh[starts + node]; k < mesh[starts + node + 1u]; k += 1u) {
        sum += area_vector(mesh[lists + k]);
    }
    return sum * inverseSqrt(max(dot(sum, sum), LEAST_DIVISOR));
}

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> Corner {
    let corner = index % 3u;
    let node = mesh[index];
    let position = (view.object * vec4<f32>(deformed(node), 1.0)).xyz;
    var share = vec3<f32>(0.0);
    share[corner] = 1.0;
    var quantity = length(state[node].xyz);
    if view.quantity == 1u {
        quantity = length(forces[node].xyz);
    }
    let normal = (view.object * vec4<f32>(node_normal(node), 0.0)).xyz;
    return Corner(view.clip * vec4<f32>(position, 1.0), position, normal, share, quantity);
}

fn mapped(share: f32) -> vec3<f32> {
    let place = clamp(share, 0.0, 1.0) * 4.0;
    let below = min(u32(place), 3u);
    return mix(view.stops[below].rgb, view.stops[below + 1u].rgb, place - f32(below));
}

@fragment
fn fragment(in: Corner) -> @location(0) vec4<f32> {
    let normal = normalize(in.normal);
    let plain = mapped(in.quantity / max(view.colour_top, LEAST_DIVISOR));
    var colour = lit(plain, normal, normalize(view.eye.xyz - in.position));
    if view.edge_width > 0.0 {
        let distance = in.share / max(fwidth(in.share), vec3<f32>(LEAST_DIVISOR));
        let nearest = min(distance.x, min(distance.y, distance.z));
        colour = mix(colour * 0.78, colour, smoothstep(view.edge_width - 0.5, view.edge_width + 0.5, nearest));
    }
    return shown(colour);
}
