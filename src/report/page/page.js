"use strict";
(async () => {
const element = (id) => document.getElementById(id);
const scene = JSON.parse(element("scene").textContent);
const { body, rows, plane, joints } = scene;

// The arrays: deflated, base64, each by its type, place in bytes and length.
const packed = Uint8Array.from(atob(element("data").textContent), (letter) => letter.charCodeAt(0));
const inflating = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
const bytes = await new Response(inflating).arrayBuffer();
const TYPES = { f32: Float32Array, i16: Int16Array, u32: Uint32Array, u8: Uint8Array };
const array = ({ type, at, length }) => new TYPES[type](bytes, at, length);

// Text.
const digits = (value, places) => (Number.isFinite(value) ? value.toPrecision(places) : "none").replace("-", "\u2212");
const subscript = (number) => String(number).replace(/\d/g, (digit) => "₀₁₂₃₄₅₆₇₈₉"[digit]);
const torqueName = (joint) => `τ${subscript(joint + 1)} ${joints[joint].name}`;
for (const [what, value] of scene.facts) {
    const row = document.createElement("div");
    row.append(document.createElement("dt"), document.createElement("dd"));
    [row.firstChild.textContent, row.lastChild.textContent] = [what, value];
    element("facts").append(row);
}

// Colours: of the figures; a series too dark for a dark sheet is lightened.
const isDark = matchMedia("(prefers-color-scheme: dark)");
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
const rgb = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16) / 255);
const onSheet = (hex) => (isDark.matches ? `rgb(${rgb(hex).map((c) => Math.round(255 * (c + 0.35 * (1 - c)))).join(" ")})` : hex);
const pale = scene.palette.pale.map(rgb);
const atShare = (list, share) => list[Math.round(Math.min(Math.max(share, 0), 1) * (list.length - 1))];
const DASHES = [[], [7, 3], [2, 2], [9, 3, 2, 3], [5, 5], [1, 3]];

// What is shown.
let time = scene.begin, playing = false, shownJoint = 0;
const times = rows ? array(rows.time) : new Float32Array([0]);
const [first, last] = [times[0], times[times.length - 1]];
/** Number of the last entry of ascending `list` that is not after `t`, 0 at least. */
function before(list, t) {
    let [low, high] = [0, list.length - 1];
    while (low < high) {
        const middle = (low + high + 1) >> 1;
        if (list[middle] <= t) low = middle; else high = middle - 1;
    }
    return low;
}

// Sheets: canvases in CSS pixels.
function sheet(canvas) {
    const scale = devicePixelRatio || 1, { clientWidth: width, clientHeight: height } = canvas;
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(height * scale);
    const context = canvas.getContext("2d");
    context.scale(scale, scale);
    context.font = "11.5px system-ui, sans-serif";
    return { context, width, height };
}
/** Round numbers between `low` and `high`, some `count`. */
function ticks([low, high], count) {
    const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
    const step = power * [1, 2, 5, 10].find((round) => round * power >= raw * 0.999);
    const marks = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) marks.push(k * step);
    if (marks.length < 2) return ticks([low, high], count + 1);
    return marks.map((value) => [value, value.toFixed(Math.max(0, -Math.floor(Math.log10(step) + 1e-9))).replace("-", "\u2212")]);
}
/** A panel with light grid, tick labels, and titles: above for the vertical axis, below for the horizontal one. */
function panel(context, area, across, up, titles) {
    const x = (value) => area.x + ((value - across[0]) / (across[1] - across[0])) * area.width;
    const y = (value) => area.y + area.height - ((value - up[0]) / (up[1] - up[0])) * area.height;
    context.strokeStyle = css("grid");
    context.fillStyle = css("soft");
    context.lineWidth = 1;
    context.setLineDash([]);
    const line = (...points) => { context.beginPath(); points.forEach(([a, b]) => context.lineTo(a, b)); context.stroke(); };
    context.textAlign = "right";
    for (const [value, label] of ticks(up, Math.max(2, area.height / 45))) {
        line([area.x, y(value)], [area.x + area.width, y(value)]);
        context.fillText(label, area.x - 6, y(value) + 4);
    }
    context.textAlign = "center";
    for (const [value, label] of ticks(across, Math.max(2, area.width / 70))) {
        line([x(value), area.y], [x(value), area.y + area.height]);
        context.fillText(label, x(value), area.y + area.height + 15);
    }
    context.fillStyle = css("ink");
    context.fillText(titles.across, area.x + area.width / 2, area.y + area.height + 31);
    context.textAlign = "left";
    context.fillText(titles.up, area.x - 44, area.y - 10);
    return { x, y, line };
}

// Curves of torque, a lane for each unit.
const torque = rows && array(rows.torque), contact = rows && array(rows.contact), way = rows && array(rows.q);
const units = [...new Set(joints.map((joint) => joint.effort))];
let timeOfPlot = () => time;
function drawPlot() {
    const canvas = element("plot"), LANE = 150, GAP = 50;
    canvas.style.height = `${units.length * LANE + (units.length + 1) * GAP - 26}px`;
    const { context, width } = sheet(canvas);
    units.forEach((unit, lane) => {
        const area = { x: 52, y: 26 + lane * (LANE + GAP), width: width - 62, height: LANE };
        const own = joints.map((_, joint) => joint).filter((joint) => joints[joint].effort === unit);
        let [low, high] = [0, 0];
        for (let row = 0; row < times.length; row++) {
            for (const joint of own) {
                const value = torque[row * joints.length + joint];
                if (value < low) low = value; else if (value > high) high = value;
            }
        }
        const margin = 0.06 * (high - low) || 1;
        const across = [first, last > first ? last : first + 1];
        context.fillStyle = css("shade");
        const left = (t) => area.x + ((t - across[0]) / (across[1] - across[0])) * area.width;
        for (let row = 0; row < times.length; row++) {
            if (!contact[row]) continue;
            const begin = row;
            while (row + 1 < times.length && contact[row + 1]) row++;
            context.fillRect(left(times[begin]), area.y, Math.max(left(times[row]) - left(times[begin]), 1), area.height);
        }
        const titles = { across: lane === units.length - 1 ? "Time [s]" : "", up: `${unit === "N" ? "Force" : "Torque"} [${unit}]; shaded: in contact` };
        const { x, y, line } = panel(context, area, across, [low - margin, high + margin], titles);
        timeOfPlot = (at) => across[0] + ((at - area.x) / area.width) * (across[1] - across[0]);
        for (const joint of own) {
            context.strokeStyle = onSheet(joints[joint].colour);
            context.lineWidth = 1.8;
            context.setLineDash(DASHES[joint % DASHES.length]);
            context.beginPath();
            times.forEach((t, row) => context.lineTo(x(t), y(torque[row * joints.length + joint])));
            context.stroke();
        }
        context.strokeStyle = css("ink");
        context.lineWidth = 1;
        context.setLineDash([]);
        line([x(time), area.y - 4], [x(time), area.y + area.height]);
        const row = before(times, time);
        for (const joint of own) {
            context.fillStyle = onSheet(joints[joint].colour);
            context.beginPath();
            context.arc(x(time), y(torque[row * joints.length + joint]), 3.5, 0, 7);
            context.fill();
        }
    });
}
function buildLegend() {
    element("legend").replaceChildren(...joints.map((joint, number) => {
        const item = document.createElement("li");
        item.innerHTML = '<svg width="30" height="8" aria-hidden="true"><line x2="30" y1="4" y2="4" stroke-width="2"/></svg> <span></span>';
        const line = item.querySelector("line");
        line.setAttribute("stroke", onSheet(joint.colour));
        line.setAttribute("stroke-dasharray", DASHES[number % DASHES.length].join(" "));
        return item;
    }));
}
function showNumbers() {
    element("clock").textContent = `${time.toFixed(3)} s`;
    element("time").value = time;
    element("time").setAttribute("aria-valuetext", `${time.toFixed(2)} seconds`);
    const row = before(times, time);
    element("legend").querySelectorAll("span").forEach((span, joint) => {
        span.textContent = `${torqueName(joint)} ${digits(torque[row * joints.length + joint], 3)} ${joints[joint].effort}`;
    });
}

// The plane of C-space.
function drawMap() {
    const { context, width, height } = sheet(element("map"));
    const { axes, start, step, count } = plane, [across, up] = [0, 1].map((side) => [start[side] - step[side] / 2, start[side] + (count[side] - 0.5) * step[side]]);
    const area = { x: 52, y: 26, width: width - 128, height: height - 66 };
    const title = (axis) => `q${subscript(axis + 1)} ${joints[axis].name} [${joints[axis].unit}]`;
    const { x, y } = panel(context, area, across, up, { across: title(axes[0]), up: title(axes[1]) });
    const values = array(plane.torque), cells = count[0] * count[1], bound = plane.bounds[shownJoint];
    const [wide, high] = [area.width / count[0], area.height / count[1]];
    context.fillStyle = "#ffffff";
    context.fillRect(area.x, area.y, area.width, area.height);
    for (let cell = 0; cell < cells; cell++) {
        const value = values[shownJoint * cells + cell];
        if (value === 0) continue;
        context.fillStyle = Number.isNaN(value) ? css("frame") : atShare(scene.palette.diverging, 0.5 + 0.5 * (value / bound));
        context.fillRect(area.x + (cell % count[0]) * wide, area.y + area.height - (Math.floor(cell / count[0]) + 1) * high, wide + 0.5, high + 0.5);
    }
    context.save();
    context.beginPath();
    context.rect(area.x, area.y, area.width, area.height);
    context.clip();
    context.strokeStyle = "#222b36";
    context.lineWidth = 1.6;
    const boundary = array(plane.boundary);
    context.beginPath();
    for (let at = 0; at < boundary.length; at += 4) {
        context.moveTo(x(boundary[at]), y(boundary[at + 1]));
        context.lineTo(x(boundary[at + 2]), y(boundary[at + 3]));
    }
    context.stroke();
    const place = (row) => axes.map((axis) => way[row * joints.length + axis]);
    if (rows) {
        for (const [colour, thickness, dash] of [["#ffffff", 4, []], ["#7a3f9d", 2, [5, 3]]]) {
            [context.strokeStyle, context.lineWidth] = [colour, thickness];
            context.setLineDash(dash);
            context.beginPath();
            times.forEach((_, row) => { const [a, b] = place(row); context.lineTo(x(a), y(b)); });
            context.stroke();
        }
    }
    context.setLineDash([]);
    const now = rows ? place(before(times, time)) : plane.at;
    if (now) {
        for (const [colour, thickness] of [["#ffffff", 5], ["#222b36", 2.5]]) {
            [context.strokeStyle, context.lineWidth] = [colour, thickness];
            context.beginPath();
            context.arc(x(now[0]), y(now[1]), 6, 0, 7);
            context.stroke();
        }
    }
    context.restore();
    context.strokeStyle = css("frame");
    context.strokeRect(area.x, area.y, area.width, area.height);
    // The colour bar.
    const bar = { x: area.x + area.width + 14, width: 11 };
    for (let k = 0; k < area.height; k++) {
        context.fillStyle = atShare(scene.palette.diverging, 1 - k / area.height);
        context.fillRect(bar.x, area.y + k, bar.width, 1.5);
    }
    context.fillStyle = css("soft");
    context.textAlign = "left";
    for (const [value, label] of ticks([-bound, bound], 5)) {
        context.fillText(label, bar.x + bar.width + 5, area.y + area.height * (0.5 - value / bound / 2) + 4);
    }
    context.fillStyle = css("ink");
    context.textAlign = "right";
    context.fillText(`${torqueName(shownJoint)} [${joints[shownJoint].effort}]`, width - 2, area.y - 10);
}

// Object and arm: WebGL 2.
const fromBody = body && (() => {
    const rest = array(body.rest), triangles = array(body.triangles), moves = array(body.moves), nodes = rest.length / 3;
    const frames = body.times.length, shapes = new Float32Array(frames * rest.length);
    // Each frame is what has moved since the one before, in units of `unit`.
    const moved = new Int32Array(rest.length);
    for (let frame = 0, at = 0; frame < frames; frame++) {
        for (let k = 0; k < rest.length; k++, at++) shapes[at] = rest[k] + body.unit * (moved[k] += moves[at]);
    }
    const edges = new Set();
    for (let at = 0; at < triangles.length; at += 3) {
        for (let side = 0; side < 3; side++) {
            const [a, b] = [triangles[at + side], triangles[at + (side + 1) % 3]];
            edges.add(Math.min(a, b) * nodes + Math.max(a, b));
        }
    }
    const lines = new Uint32Array(2 * edges.size);
    [...edges].forEach((edge, k) => lines.set([Math.floor(edge / nodes), edge % nodes], 2 * k));
    let [low, high] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
    rest.forEach((value, k) => { low[k % 3] = Math.min(low[k % 3], value); high[k % 3] = Math.max(high[k % 3], value); });
    return { rest, triangles, nodes, shapes, lines, centre: low.map((value, k) => (value + high[k]) / 2), radius: Math.hypot(...low.map((value, k) => high[k] - value)) / 2,
        rods: array(body.rods), radii: array(body.radii), kinds: array(body.kinds), owners: array(body.owners), poses: array(body.poses), forces: array(body.forces),
        links: body.links.map((link) => ({ joint: link.joint, nodes: array(link.nodes), triangles: array(link.triangles) })) };
})();

const sum = (a, b, s = 1) => a.map((value, k) => value + s * b[k]);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => { const length = Math.hypot(...a) || 1; return a.map((value) => value / length); };

/** Triangles with a normal and a colour at each corner. */
class Solids {
    constructor() { this.values = new Float32Array(1 << 16); this.length = 0; }
    corner(place, normal, colour) {
        if (this.length + 9 > this.values.length) {
            const larger = new Float32Array(2 * this.values.length);
            larger.set(this.values);
            this.values = larger;
        }
        this.values.set(place, this.length);
        this.values.set(normal, this.length + 3);
        this.values.set(colour, this.length + 6);
        this.length += 9;
    }
    /** The side of a cone between two ends, with `sides` facets; a base where `closed`. */
    cone(from, to, radii, colour, sides, closed) {
        const axis = unit(sum(to, from, -1)), u = unit(cross(axis, Math.abs(axis[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0])), v = cross(axis, u);
        const length = Math.hypot(...sum(to, from, -1)), slope = (radii[0] - radii[1]) / (length || 1);
        const round = (k) => { const angle = (2 * Math.PI * k) / sides; return u.map((value, i) => Math.cos(angle) * value + Math.sin(angle) * v[i]); };
        for (let k = 0; k < sides; k++) {
            const [a, b] = [round(k), round(k + 1)], [na, nb] = [a, b].map((out) => unit(sum(out, axis, slope)));
            const [a0, b0, a1, b1] = [sum(from, a, radii[0]), sum(from, b, radii[0]), sum(to, a, radii[1]), sum(to, b, radii[1])];
            [[a0, na], [b0, nb], [b1, nb], [a0, na], [b1, nb], [a1, na]].forEach(([place, normal]) => this.corner(place, normal, colour));
            if (closed) [from, b0, a0].forEach((place) => this.corner(place, axis.map((value) => -value), colour));
        }
    }
    ball(centre, radius, colour) {
        const [ROWS, COLUMNS] = [8, 14];
        const out = (row, column) => {
            const [a, b] = [(Math.PI * row) / ROWS, (2 * Math.PI * column) / COLUMNS];
            return [Math.sin(a) * Math.cos(b), Math.sin(a) * Math.sin(b), Math.cos(a)];
        };
        for (let row = 0; row < ROWS; row++) {
            for (let column = 0; column < COLUMNS; column++) {
                const [a, b, c, d] = [out(row, column), out(row + 1, column), out(row + 1, column + 1), out(row, column + 1)];
                [a, b, c, a, c, d].forEach((normal) => this.corner(sum(centre, normal, radius), normal, colour));
            }
        }
    }
}

const camera = {};
function resetCamera() {
    const [x, y, z] = unit(body.view);
    Object.assign(camera, { azimuth: Math.atan2(y, x), elevation: Math.asin(z), distance: (1.15 * fromBody.radius) / Math.sin(0.21) });
}
let draw3d = () => {};
function begin3d() {
    const canvas = element("view"), gl = canvas.getContext("webgl2", { antialias: true });
    if (!gl) {
        element("state").textContent = "This browser draws no WebGL 2: object and arm are not shown.";
        return;
    }
    const shader = (type, text) => { const made = gl.createShader(type); gl.shaderSource(made, text); gl.compileShader(made); return made; };
    let program, place, indices, buffers;
    function build() {
        program = gl.createProgram();
        gl.attachShader(program, shader(gl.VERTEX_SHADER, `#version 300 es
            layout(location = 0) in vec3 place; layout(location = 1) in vec3 normal; layout(location = 2) in vec3 colour;
            uniform mat4 clip; out vec3 out_normal; out vec3 out_colour;
            void main() { gl_Position = clip * vec4(place, 1.0); out_normal = normal; out_colour = colour; }`));
        gl.attachShader(program, shader(gl.FRAGMENT_SHADER, `#version 300 es
            precision mediump float; in vec3 out_normal; in vec3 out_colour; uniform vec3 light; uniform vec4 line; out vec4 result;
            void main() {
                if (line.a > 0.0) { result = vec4(line.rgb * line.a, line.a); return; }
                vec3 n = normalize(out_normal) * (gl_FrontFacing ? 1.0 : -1.0);
                result = vec4(out_colour * (0.42 + 0.5 * max(dot(n, light), 0.0) + 0.12 * n.z), 1.0);
            }`));
        gl.linkProgram(program);
        place = Object.fromEntries(["clip", "light", "line"].map((name) => [name, gl.getUniformLocation(program, name)]));
        buffers = [0, 1].map(() => gl.createBuffer());
        indices = [fromBody.triangles, fromBody.lines].map((list) => {
            const buffer = gl.createBuffer();
            gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffer);
            gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, list, gl.STATIC_DRAW);
            return buffer;
        });
    }
    build();
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => { build(); draw3d(); });
    const surface = new Float32Array(9 * fromBody.nodes), solids = new Solids();

    draw3d = () => {
        const { rest, triangles, nodes, shapes } = fromBody;
        const frame = before(body.times, time), next = Math.min(frame + 1, body.times.length - 1);
        const share = next > frame ? Math.min(Math.max((time - body.times[frame]) / (body.times[next] - body.times[frame]), 0), 1) : 0;
        const mixed = (list, size, k) => list[frame * size + k] * (1 - share) + list[next * size + k] * share;
        // The arm's own colours are for a light sheet.
        const [ARM, NODE, FORCE] = ["arm", "node", "force"].map((name) => rgb(scene.palette[name]).map((c) => (isDark.matches && name !== "force" ? c + 0.35 * (1 - c) : c)));
        surface.fill(0);
        let largest = 0;
        for (let node = 0; node < nodes; node++) {
            let square = 0;
            for (let axis = 0; axis < 3; axis++) {
                const value = mixed(shapes, 3 * nodes, 3 * node + axis);
                surface[9 * node + axis] = value;
                square += (value - rest[3 * node + axis]) ** 2;
            }
            surface.set(atShare(pale, Math.sqrt(square) / (body.largest || 1)), 9 * node + 6);
            largest = Math.max(largest, Math.sqrt(square));
        }
        for (let at = 0; at < triangles.length; at += 3) {
            const [a, b, c] = [0, 1, 2].map((corner) => 9 * triangles[at + corner]);
            const [ux, uy, uz, vx, vy, vz] = [0, 1, 2].map((k) => surface[b + k] - surface[a + k]).concat([0, 1, 2].map((k) => surface[c + k] - surface[a + k]));
            const normal = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
            for (const corner of [a, b, c]) for (let k = 0; k < 3; k++) surface[corner + 3 + k] += normal[k];
        }
        solids.length = 0;
        const { rods, radii, kinds, owners, poses, forces, links, radius } = fromBody;
        const still = [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0], frames = Array.from({ length: body.frames }, (_, link) => still.map((_, k) => mixed(poses, 12 * body.frames, 12 * link + k)));
        const world = (matrix, list, at) => [0, 1, 2].map((axis) => matrix[9 + axis] + matrix[axis] * list[at] + matrix[3 + axis] * list[at + 1] + matrix[6 + axis] * list[at + 2]);
        for (let k = 0; k < kinds.length; k++) {
            const [from, to] = [2 * k, 2 * k + 1].map((end) => world(frames[owners[end]], rods, 3 * end));
            const colour = kinds[k] ? NODE : ARM, own = [radii[2 * k], radii[2 * k + 1]];
            solids.ball(from, own[0], colour);
            if (Math.hypot(...sum(to, from, -1)) < 1e-9) continue;
            solids.ball(to, own[1], colour);
            solids.cone(from, to, own, colour, 16, false);
        }
        for (const link of links) {
            const matrix = link.joint === null ? still : frames[link.joint];
            for (let at = 0; at < link.triangles.length; at += 3) {
                const [a, b, c] = [0, 1, 2].map((corner) => world(matrix, link.nodes, 3 * link.triangles[at + corner])), normal = unit(cross(sum(b, a, -1), sum(c, a, -1)));
                [a, b, c].forEach((corner) => solids.corner(corner, normal, ARM));
            }
        }
        // Forces on the arm, from the nodes that push: as long as the figures have them.
        const begin = body.counts.slice(0, frame).reduce((total, count) => total + count, 0);
        const total = [0, 0, 0];
        for (let k = begin; k < begin + body.counts[frame]; k++) {
            const [node, ...force] = forces.subarray(4 * k, 4 * k + 4), size = Math.hypot(...force);
            force.forEach((value, axis) => { total[axis] -= value; });
            if (size < 0.02 * body.force) continue;
            const tail = [...surface.subarray(9 * node, 9 * node + 3)], span = force.map((value) => (-0.7 * radius * value) / body.force);
            const length = Math.hypot(...span), head = Math.min(0.11 * radius, 0.4 * length), neck = sum(tail, span, 1 - head / length);
            solids.cone(tail, neck, [head / 5, head / 5], FORCE, 8, true);
            solids.cone(neck, sum(tail, span), [head / 2, 0], FORCE, 12, true);
        }
        const touching = body.touching[frame];
        const contact = touching ? `In contact: ${touching} nodes of the object, ${digits(Math.hypot(...total), 2)} N` : "Free";
        const isSolved = body.largest || body.force;
        element("state").textContent = isSolved ? contact + (body.largest ? `; moved by up to ${digits(1e3 * largest, 2)} mm` : "") : "The object at rest";

        const scale = devicePixelRatio || 1;
        const [wide, high] = [canvas.clientWidth, canvas.clientHeight].map((side) => Math.max(1, Math.round(side * scale)));
        // To set a size takes new memory, even if it is the same.
        if (canvas.width !== wide || canvas.height !== high) [canvas.width, canvas.height] = [wide, high];
        gl.viewport(0, 0, canvas.width, canvas.height);
        gl.clearColor(...rgb(css("raised")), 1);
        gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
        gl.enable(gl.DEPTH_TEST);
        gl.enable(gl.BLEND);
        gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
        gl.useProgram(program);
        const aspect = canvas.width / canvas.height, { azimuth, elevation } = camera, distance = camera.distance / Math.min(aspect, 1);
        const toward = [Math.cos(elevation) * Math.cos(azimuth), Math.cos(elevation) * Math.sin(azimuth), Math.sin(elevation)];
        const right = [-Math.sin(azimuth), Math.cos(azimuth), 0], up = cross(toward, right), eye = sum(fromBody.centre, toward, distance);
        const focal = 1 / Math.tan(0.21), [near, far] = [0.02 * distance, 40 * distance], depth = (near + far) / (near - far);
        const along = (axis, factor) => [...axis, -axis.reduce((total, value, k) => total + value * eye[k], 0)].map((value) => factor * value);
        const [rowX, rowY, rowW] = [along(right, focal / aspect), along(up, focal), along(toward, -1)];
        const rowZ = rowW.map((value, k) => -depth * value + (k === 3 ? (2 * near * far) / (near - far) : 0));
        gl.uniformMatrix4fv(place.clip, false, [0, 1, 2, 3].flatMap((k) => [rowX[k], rowY[k], rowZ[k], rowW[k]]));
        gl.uniform3fv(place.light, unit(sum(sum(toward, up, 0.6), right, -0.4)));
        const bind = (buffer, values) => {
            gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
            gl.bufferData(gl.ARRAY_BUFFER, values, gl.DYNAMIC_DRAW);
            [0, 1, 2].forEach((slot) => { gl.enableVertexAttribArray(slot); gl.vertexAttribPointer(slot, 3, gl.FLOAT, false, 36, 12 * slot); });
        };
        const colourOfLines = (colour) => gl.uniform4fv(place.line, colour);
        colourOfLines([0, 0, 0, 0]);
        bind(buffers[0], solids.values.subarray(0, solids.length));
        gl.drawArrays(gl.TRIANGLES, 0, solids.length / 9);
        bind(buffers[1], surface);
        gl.enable(gl.POLYGON_OFFSET_FILL);
        gl.polygonOffset(1, 1);
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, indices[0]);
        gl.drawElements(gl.TRIANGLES, triangles.length, gl.UNSIGNED_INT, 0);
        gl.disable(gl.POLYGON_OFFSET_FILL);
        colourOfLines([0.13, 0.17, 0.21, 0.28]);
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, indices[1]);
        gl.drawElements(gl.LINES, fromBody.lines.length, gl.UNSIGNED_INT, 0);
    };

    // Pointers: one turns, two zoom.
    const pointers = new Map();
    const spread = () => { const [a, b] = [...pointers.values()]; return Math.hypot(a[0] - b[0], a[1] - b[1]); };
    const turn = (x, y) => {
        camera.azimuth -= x;
        camera.elevation = Math.min(Math.max(camera.elevation + y, -1.55), 1.55);
        refresh();
    };
    const zoom = (factor) => { camera.distance *= factor; refresh(); };
    canvas.addEventListener("pointerdown", (event) => {
        pointers.set(event.pointerId, [event.clientX, event.clientY]);
        try { canvas.setPointerCapture(event.pointerId); } catch { /* The pointer has gone already. */ }
    });
    canvas.addEventListener("pointermove", (event) => {
        const earlier = pointers.get(event.pointerId);
        if (!earlier) return;
        const apart = pointers.size === 2 ? spread() : 0;
        pointers.set(event.pointerId, [event.clientX, event.clientY]);
        if (apart) zoom(apart / Math.max(spread(), 1));
        else turn((3 * (event.clientX - earlier[0])) / canvas.clientHeight, (3 * (event.clientY - earlier[1])) / canvas.clientHeight);
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => pointers.delete(event.pointerId));
    canvas.addEventListener("wheel", (event) => {
        // Without Ctrl the wheel scrolls the page.
        if (!event.ctrlKey) return;
        event.preventDefault();
        zoom(Math.exp(0.0015 * event.deltaY));
    }, { passive: false });
    const reset = () => { resetCamera(); refresh(); };
    const KEYS = { ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0), ArrowUp: () => turn(0, 0.1), ArrowDown: () => turn(0, -0.1), "+": () => zoom(0.9), "=": () => zoom(0.9), "-": () => zoom(1.1), 0: reset };
    canvas.addEventListener("keydown", (event) => {
        if (!KEYS[event.key] || event.ctrlKey || event.metaKey) return;
        event.preventDefault();
        KEYS[event.key]();
    });
    canvas.addEventListener("dblclick", reset);
    element("nearer").onclick = () => zoom(0.8);
    element("farther").onclick = () => zoom(1.25);
    element("reset").onclick = reset;
}

// One drawing for all that changes before the next frame.
let isDue = false;
function refresh() {
    if (isDue) return;
    isDue = true;
    requestAnimationFrame(() => {
        isDue = false;
        if (body) draw3d();
        if (plane) drawMap();
        if (rows) { drawPlot(); showNumbers(); }
    });
}
function setTime(t) {
    time = Math.min(Math.max(t, first), last);
    refresh();
}
function setPlaying(on) {
    if (playing === on) return;
    playing = on;
    element("play").textContent = on ? "❚❚" : "▶";
    element("play").setAttribute("aria-label", on ? "Pause" : "Play");
    if (!on) return;
    if (time >= last) time = first;
    let earlier = performance.now();
    const step = (now) => {
        if (!playing) return;
        setTime(time + Math.max(now - earlier, 0) / 1000);
        earlier = now;
        if (time >= last) setPlaying(false); else requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
}

if (body) {
    element("body").hidden = false;
    resetCamera();
    begin3d();
    element("moved").style.background = `linear-gradient(to right, ${scene.palette.pale.join(", ")})`;
    if (!body.largest) element("moved").parentElement.hidden = true;
    if (!body.force) element("arrow-range").parentElement.hidden = true;
    element("moved-range").textContent = `moved, 0 to ${digits(1e3 * body.largest, 3)} mm`;
    element("arrow-range").textContent = `force on the arm, longest ${digits(body.force, 2)} N`;
    element("arrow-head").setAttribute("fill", scene.palette.force);
    element("arrow-shaft").setAttribute("stroke", scene.palette.force);
    element("arrow-shaft").setAttribute("stroke-width", 3);
}
if (plane) {
    element("plane").hidden = false;
    element("joint").append(...joints.map((_, joint) => new Option(torqueName(joint), joint)));
    element("joint").onchange = (event) => { shownJoint = Number(event.target.value); refresh(); };
    element("caption").textContent = plane.caption + (rows ? "; dashed: the way of the arm, ring: now" : plane.at ? "; ring: this configuration" : "");
}
if (rows) {
    element("curves").hidden = false;
    Object.assign(element("time"), { min: first, max: last });
    element("time").oninput = (event) => { setPlaying(false); setTime(Number(event.target.value)); };
    element("play").onclick = () => setPlaying(!playing);
    const seek = (event) => { if (event.buttons) { setPlaying(false); setTime(timeOfPlot(event.offsetX)); } };
    element("plot").addEventListener("pointerdown", seek);
    element("plot").addEventListener("pointermove", seek);
    buildLegend();
}
isDark.addEventListener("change", () => { if (rows) buildLegend(); refresh(); });
addEventListener("resize", refresh);
refresh();
})();
