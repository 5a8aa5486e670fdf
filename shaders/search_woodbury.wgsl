// What the preconditioner of a step's linear solve needs: the displacement of the support by a unit push of each row
// that touches, and the inverse of the small system of these pushes (twin: src/contact/equilibrium/woodbury.rs, which
// factorises it).

// Sets it up.
fn factorise(local: u32) {
    begin_list(0u, local);
    for (var first = 0u; first < row_count; first += WORKGROUP) {
        let row = first + local;
        let is_taken = row < row_count && is_active(min(row, row_count - 1u));
        let entry = place_in_list(select(0u, 1u, is_taken), local);
        if is_taken {
            set_word(at_taken(entry), row);
        }
    }
    let taken = listed;
    is_near = taken <= NEAR_ORDER;
    if local == 0u {
        set_word(TAKEN, taken);
    }
    sync();
    let kc = scalar(STIFFNESS);
    let stiffening = scalar(STIFFENING);
    for (var slot = local; slot < slots; slot += WORKGROUP) {
        put(PREVIOUS_FORCE, slot, vector_entry(STEP_FORCE, slot));
        put(PREVIOUS_DISPLACEMENT, slot, vector_entry(STEP_DISPLACEMENT, slot));
    }
    for (var pair = local; pair < taken * slots; pair += WORKGROUP) {
        write_column(pair / slots, pair % slots);
    }
    sync();
    for (var pair = local; pair < taken * taken; pair += WORKGROUP) {
        let a = pair / taken;
        let b = pair % taken;
        var deepened = deepening(a, b);
        if a == b {
            deepened += stiffening / (kc * scalar(numbers(word(at_taken(b))) + SHARE));
            set_scalar(at_push(b), deepened);
        }
        set_entry(a, b, deepened);
    }
    invert(taken, local);
    if local == 0u {
        tally(ELIMINATIONS, taken * taken * taken);
        set_word(IS_FIRST, 1u);
        let pairs = (row_count * (row_count + slots) / WORKGROUP + 2u) * parameters.carriers;
        let eliminations = row_count * (row_count * (row_count / 4u + 1u) / WORKGROUP + row_count / WORKGROUP + 2u);
        let next = select(PRECONDITION, RESPOND, word(PURPOSE) == FOR_TANGENT);
        advance(next, slots / WORKGROUP + 1u + pairs + eliminations);
    }
}

// Displacement of the node in `slot` by a unit push of the row that touches in place `a`.
fn write_column(a: u32, slot: u32) {
    let row = word(at_taken(a));
    let place = word(at_place(slot));
    let places = row_words(row) + ROW_WORDS;
    let weights = numbers(row) + NODE_WEIGHTS;
    if ISOTROPIC {
        var size = real(0.0);
        for (var j = 0u; j < parameters.carriers; j += 4u) {
            let effects = vec4<real>(along_row(places + j, place), along_row(places + j + 1u, place),
                along_row(places + j + 2u, place), along_row(places + j + 3u, place));
            size += dot(four_at(weights + j), effects);
        }
        vectors[column_base(a) + slot / 4u][slot % 4u] = size;
    } else {
        let normal = vector_at(numbers(row) + NORMAL);
        var moved = vec3<real>(0.0);
        for (var j = 0u; j < parameters.carriers; j += 1u) {
            moved += moved_by(word(places + j), scalar(weights + j) * normal, place);
        }
        vectors[column_base(a) + slot] = vec4<real>(moved, 0.0);
    }
}

fn along_row(carrier: u32, place: u32) -> real {
    return compliance[word(carrier) * parameters.covered + place];
}

// By how much a unit push of the row that touches in place `a` deepens the one in place `b`.
fn deepening(a: u32, b: u32) -> real {
    let row = word(at_taken(b));
    let normal = vector_at(numbers(row) + NORMAL);
    let weights = numbers(row) + NODE_WEIGHTS;
    var sum = real(0.0);
    if ISOTROPIC {
        for (var j = 0u; j < parameters.carriers; j += 4u) {
            sum += dot(four_at(weights + j), vec4<real>(column_size(a, slot_of(row, j)),
                column_size(a, slot_of(row, j + 1u)), column_size(a, slot_of(row, j + 2u)),
                column_size(a, slot_of(row, j + 3u))));
        }
        return sum * dot(normal, vector_at(numbers(word(at_taken(a))) + NORMAL));
    }
    for (var j = 0u; j < parameters.carriers; j += 1u) {
        sum += scalar(weights + j) * dot(normal, column_entry(a, slot_of(row, j)));
    }
    return sum;
}

// Up to this order a system is inverted in the workgroup's own memory.
const NEAR_ORDER: u32 = 24u;
var<workgroup> near_inverse: array<real, NEAR_ORDER * NEAR_ORDER>;
var<private> is_near: bool;

fn entry_of(row: u32, column: u32) -> real {
    if is_near {
        return near_inverse[row * NEAR_ORDER + column];
    }
    return scalar(at_inverse(row, column));
}

fn set_entry(row: u32, column: u32, value: real) {
    if is_near {
        near_inverse[row * NEAR_ORDER + column] = value;
    } else {
        set_scalar(at_inverse(row, column), value);
    }
}

// Inverts the system of the pushes in place, by Gauss-Jordan elimination, which a positive definite matrix lets do
// without pivoting. What rounding leaves of a pivot is not believed below its own rounding; the diagonal as it was is
// among the pushes.
fn invert(order: u32, local: u32) {
    for (var k = 0u; k < order; k += 1u) {
        sync();
        workgroupBarrier();
        let pivot = 1.0 / max(entry_of(k, k), PIVOT_ROUNDING * scalar(at_push(k)));
        for (var item = local; item < (order + 3u) / 4u * order; item += WORKGROUP) {
            let row = item / order * 4u;
            let column = item % order;
            if column != k {
                let share = entry_of(k, column) * pivot;
                eliminate(row, order, column, k, share);
                eliminate(row + 1u, order, column, k, share);
                eliminate(row + 2u, order, column, k, share);
                eliminate(row + 3u, order, column, k, share);
            }
        }
        sync();
        workgroupBarrier();
        for (var j = local; j < order; j += WORKGROUP) {
            if j == k {
                set_entry(k, k, pivot);
            } else {
                set_entry(k, j, entry_of(k, j) * pivot);
                set_entry(j, k, -entry_of(j, k) * pivot);
            }
        }
    }
    sync();
    workgroupBarrier();
    for (var item = local; is_near && item < order * order; item += WORKGROUP) {
        set_scalar(at_inverse(item / order, item % order), entry_of(item / order, item % order));
    }
    sync();
}

fn eliminate(row: u32, order: u32, column: u32, k: u32, share: real) {
    if row != k && row < order {
        set_entry(row, column, entry_of(row, column) - entry_of(row, k) * share);
    }
}
