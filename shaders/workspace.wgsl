// The workspace of a configuration. The stage declares `words` and `reals` of all of them. Reals are stored four by
// four, so that a vector, with which four begin, is read at once.

var<private> words_base: u32;
var<private> reals_base: u32;
// Place of the workspace, and number of its configuration in the section.
var<private> place_taken: u32;
var<private> member: u32;

// Takes up the workspace in `place`.
fn take_place(place: u32) {
    words_base = 2u * parameters.room + 1u + place * parameters.words;
    reals_base = place * parameters.reals;
    place_taken = place;
    member = words[words_base + MEMBER];
}

// Takes up unfinished configuration `index`; false where there is none.
fn take_up(index: u32) -> bool {
    if index >= words[2u * parameters.room] {
        return false;
    }
    take_place(words[index]);
    return true;
}

fn word(at: u32) -> u32 {
    return words[words_base + at];
}

fn set_word(at: u32, value: u32) {
    words[words_base + at] = value;
}

fn scalar(at: u32) -> real {
    let number = reals_base + at;
    return reals[number / 4u][number % 4u];
}

fn set_scalar(at: u32, value: real) {
    let number = reals_base + at;
    reals[number / 4u][number % 4u] = value;
}

// Four that follow each other from a multiple of four on.
fn four_at(at: u32) -> vec4<real> {
    return reals[(reals_base + at) / 4u];
}

fn set_four(at: u32, value: vec4<real>) {
    reals[(reals_base + at) / 4u] = value;
}

fn vector_at(at: u32) -> vec3<real> {
    return reals[(reals_base + at) / 4u].xyz;
}

// The scalar behind the vector becomes zero.
fn set_vector(at: u32, value: vec3<real>) {
    reals[(reals_base + at) / 4u] = vec4<real>(value, 0.0);
}
