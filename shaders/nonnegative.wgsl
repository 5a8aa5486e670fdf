// The program max over x >= 0 of b.x - 1/2 x.S x, by the invocations of a workgroup (twin, with the sources:
// src/contact/linear/nonnegative.rs). Where unknowns that break a sign no longer grow fewer, the last one alone changes
// sides, which ends, too (K. Murty, Note on a Bard-type scheme for solving the complementarity problem, 1974).
//
// Each invocation has every WORKGROUP-th row. The factor is L D L^T with the columns of L D stored: what one column
// leaves of the others is written once, and one barrier a column is enough. Bound unknowns have rows of the identity.

override TRIANGLE: u32 = ROOM * (ROOM + 1u) / 2u;

// Rounds in which all unknowns that break a sign change sides though there are no fewer of them than before.
const TRUST: u32 = 3u;

// Lower triangles of S and of the factor, row by row.
var<workgroup> matrix: array<f32, TRIANGLE>;
var<workgroup> factor: array<f32, TRIANGLE>;
var<workgroup> solution: array<f32, ROOM>;
// b - S x.
var<workgroup> slack: array<f32, ROOM>;
var<workgroup> right: array<f32, ROOM>;
// Whether an unknown is free, and whether it breaks a sign.
var<workgroup> is_free: array<u32, ROOM>;
var<workgroup> breaks: array<u32, ROOM>;

// Place of an entry on or below the diagonal.
fn entry(i: u32, j: u32) -> u32 {
    return i * (i + 1u) / 2u + j;
}

// One over pivot k; what rounding leaves of it is not believed below its own rounding.
fn inverse_pivot(k: u32) -> f32 {
    let diagonal = select(1.0, matrix[entry(k, k)], is_free[k] != 0u);
    return 1.0 / max(factor[entry(k, k)], PIVOT_ROUNDING * diagonal);
}

fn factorize(count: u32, local: u32) {
    for (var i = local; i < count; i += WORKGROUP) {
        for (var j = 0u; j <= i; j += 1u) {
            let identity = select(0.0, 1.0, i == j);
            factor[entry(i, j)] = select(identity, matrix[entry(i, j)], (is_free[i] & is_free[j]) != 0u);
        }
    }
    for (var k = 0u; k < count; k += 1u) {
        workgroupBarrier();
        let inverse = inverse_pivot(k);
        for (var i = local; i < count; i += WORKGROUP) {
            let scaled = factor[entry(i, min(i, k))] * inverse;
            for (var j = k + 1u; j <= i; j += 1u) {
                factor[entry(i, j)] -= scaled * factor[entry(j, k)];
            }
        }
    }
}

// Replaces `right` by the solution of the factorised system.
fn substitute(count: u32, local: u32) {
    for (var k = 0u; k < count; k += 1u) {
        workgroupBarrier();
        let known = right[k] * inverse_pivot(k);
        for (var i = local; i < count; i += WORKGROUP) {
            if i > k {
                right[i] -= factor[entry(i, k)] * known;
            }
        }
    }
    for (var k = count; k > 0u; k -= 1u) {
        workgroupBarrier();
        let known = right[k - 1u] * inverse_pivot(k - 1u);
        for (var i = local; i < k - 1u; i += WORKGROUP) {
            right[i] -= factor[entry(k - 1u, i)] * known;
        }
    }
    workgroupBarrier();
    for (var i = local; i < count; i += WORKGROUP) {
        right[i] *= inverse_pivot(i);
    }
    workgroupBarrier();
}

// Solves for the free unknowns, with one step of iterative refinement, and brings the slack up to date.
fn solve_free(count: u32, local: u32) {
    factorize(count, local);
    for (var i = local; i < count; i += WORKGROUP) {
        solution[i] = 0.0;
        slack[i] = rows[at_row(i) + AT_X].w;
    }
    for (var round = 0u; round < 2u; round += 1u) {
        for (var i = local; i < count; i += WORKGROUP) {
            right[i] = select(0.0, slack[i], is_free[i] != 0u);
        }
        substitute(count, local);
        for (var i = local; i < count; i += WORKGROUP) {
            solution[i] += right[i];
        }
        workgroupBarrier();
        for (var i = local; i < count; i += WORKGROUP) {
            var left = rows[at_row(i) + AT_X].w;
            for (var j = 0u; j < count; j += 1u) {
                left -= matrix[entry(max(i, j), min(i, j))] * solution[j];
            }
            slack[i] = left;
        }
    }
    workgroupBarrier();
}

// What rounding leaves of an entry of the slack.
fn slack_rounding(count: u32) -> f32 {
    var largest = 0.0;
    var sum = 0.0;
    for (var i = 0u; i < count; i += 1u) {
        largest = max(largest, matrix[entry(i, i)]);
        sum += abs(solution[i]);
    }
    return PIVOT_ROUNDING * f32(count) * largest * sum;
}

// Whether the program came to its end, and after how many rounds.
struct Ended {
    rounds: u32,
    is_solved: bool,
}

// Solves the program of the first `count` rows.
fn solve_program(count: u32, local: u32) -> Ended {
    for (var i = local; i < count; i += WORKGROUP) {
        is_free[i] = u32(rows[at_row(i) + AT_X].w > 0.0);
    }
    var fewest = count + 1u;
    var trust = TRUST;
    for (var round = 1u; round <= parameters.rounds; round += 1u) {
        workgroupBarrier();
        solve_free(count, local);
        let rounding = slack_rounding(count);
        for (var i = local; i < count; i += WORKGROUP) {
            let is_negative = solution[i] * matrix[entry(i, i)] < -rounding;
            breaks[i] = u32(select(slack[i] > rounding, is_negative, is_free[i] != 0u));
        }
        workgroupBarrier();
        var broken = 0u;
        var last = 0u;
        for (var i = 0u; i < count; i += 1u) {
            broken += breaks[i];
            last = select(last, i, breaks[i] != 0u);
        }
        if broken == 0u {
            for (var i = local; i < count; i += WORKGROUP) {
                solution[i] = max(solution[i], 0.0);
            }
            workgroupBarrier();
            return Ended(round, true);
        }
        if broken < fewest {
            fewest = broken;
            trust = TRUST;
        } else {
            trust = max(trust, 1u) - 1u;
        }
        for (var i = local; i < count; i += WORKGROUP) {
            if breaks[i] != 0u && (trust > 0u || i == last) {
                is_free[i] = 1u - is_free[i];
            }
        }
    }
    return Ended(parameters.rounds, false);
}
