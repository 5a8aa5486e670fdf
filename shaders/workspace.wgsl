// The workspace of a configuration. The stage declares `words` and `reals` of all of them, and the `list` of
// configurations in contact.

var<private> words_base: u32;
var<private> reals_base: u32;
// Number of the configuration in the section.
var<private> member: u32;

// Takes up the workspace of the configuration in `place` of the list of those in contact.
fn take_place(place: u32) {
    words_base = 2u * parameters.room + 1u + place * parameters.words;
    reals_base = place * parameters.reals;
    member = list[1u + place];
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
    return reals[reals_base + at];
}

fn set_scalar(at: u32, value: real) {
    reals[reals_base + at] = value;
}

fn vector_at(at: u32) -> vec3<real> {
    let first = reals_base + at;
    return vec3<real>(reals[first], reals[first + 1u], reals[first + 2u]);
}

fn set_vector(at: u32, value: vec3<real>) {
    let first = reals_base + at;
    reals[first] = value.x;
    reals[first + 1u] = value.y;
    reals[first + 2u] = value.z;
}
