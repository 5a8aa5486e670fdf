// The facets that are closest to points, one point an invocation, which a workgroup finds together: a search by each
// invocation alone would have all wait for the longest one, and pass through the same spheres.
//
// Bounding spheres at rest leave few facets, each near some of the points, and flat triangles leave few pairs of a
// point and a facet. As many facets are looked at together as there are invocations, and as many pairs measured,
// whosever the point is. The order of facets and pairs depends on timing; which facet is closest does not.
//
// The stage declares WORKGROUP, which is at most 32; `facet_in_order`; `need(facet)`, which notes that a facet is going
// to be looked at, and `make_ready(local)`, which makes all of these ready; and for facets that are bent their corners,
// `triangle_of(facet)`, and by how much they stand off their triangles, `bulge()`.

// Facets that share a sphere which is looked at before theirs.
const CLUSTER: u32 = 32u;

// Most facets that wait to be looked at, and most pairs that wait to be measured: fewer than are measured together, and
// each of as many facets with each point.
override FACETS_TOGETHER: u32 = 8u * WORKGROUP;
override PAIRS: u32 = WORKGROUP * (WORKGROUP + 1u);

// Each invocation's point; w is the distance beyond which no facet matters to it, below zero where there is none.
var<workgroup> points: array<vec4<real>, WORKGROUP>;
// Its closest facet so far.
var<workgroup> closest_so_far: array<u32, WORKGROUP>;
// Invocations that have a point; and those whose point is near each of as many clusters: a bit for each.
var<workgroup> with_point: atomic<u32>;
var<workgroup> near: array<u32, WORKGROUP>;
// Facets that wait to be looked at, and a bit for each point that their spheres are near enough to.
var<workgroup> facets: array<vec2<u32>, FACETS_TOGETHER>;
var<workgroup> near_facets: atomic<u32>;
// Pairs that wait to be measured: the facet times WORKGROUP, plus the point's invocation.
var<workgroup> pairs: array<u32, PAIRS>;
var<workgroup> waiting: atomic<u32>;
// Pairs that were measured: weights of the closest point, and its distance; its feature.
var<workgroup> measurements: array<vec4<real>, WORKGROUP>;
var<workgroup> features: array<u32, WORKGROUP>;

// Pairs that this invocation has measured.
var<private> measured: u32;

// Passes through loops so far, at most.
var<private> passes: u32;

// Passes through loops that it takes to measure a pair.
const PASSES_TO_MEASURE: u32 = 3u * FACET_ITERATIONS + 3u;

// The points of `mask` that may be near enough to what lay within a sphere at rest and has moved no farther than
// `moved`.
fn points_near(sphere: vec4<real>, mask: u32, moved: real) -> u32 {
    var found = 0u;
    for (var rest = mask; rest != 0u; rest &= rest - 1u) {
        let point = points[firstTrailingBit(rest)];
        let away = point.xyz - sphere.xyz;
        let reach = point.w + moved + sphere.w;
        if reach > 0.0 && dot(away, away) <= reach * reach {
            found |= rest & (~rest + 1u);
        }
    }
    return found;
}

// Lists the facet in place `leaf` of the order if its sphere may be near enough to points of `mask`.
fn list_facet(leaf: u32, mask: u32, moved: real) {
    let found = points_near(surface[parameters.leaves + leaf], mask, moved);
    if found != 0u {
        let facet = facet_in_order(leaf);
        need(facet);
        facets[atomicAdd(&near_facets, 1u)] = vec2<u32>(facet, found);
    }
}

// Pairs a facet with those points of `mask` to which it may be closer than what was found so far.
fn add_pairs(facet: u32, mask: u32) {
    var corners = mat3x3<real>();
    if SMOOTH {
        corners = triangle_of(facet);
    }
    for (var rest = mask; rest != 0u; rest &= rest - 1u) {
        let owner = firstTrailingBit(rest);
        var may_be_closest = closest_so_far[owner] != facet;
        if SMOOTH && may_be_closest {
            let point = points[owner];
            let weights = closest_point(point.xyz, corners[0], corners[1], corners[2]).weights;
            may_be_closest = distance(corners * weights, point.xyz) <= point.w + bulge();
        }
        if may_be_closest {
            pairs[atomicAdd(&waiting, 1u)] = facet * WORKGROUP + owner;
        }
    }
}

// Measures the pairs from `first` to `end`, at most one an invocation. Returns the closest facet to this one's point,
// which was `best`.
fn measure(first: u32, end: u32, best: Closest, local: u32) -> Closest {
    if first + local < end {
        let pair = pairs[first + local];
        form(pair / WORKGROUP, points[pair % WORKGROUP].xyz);
        let found = closest_on_facet();
        measurements[local] = vec4<real>(found.point.weights, found.distance);
        features[local] = found.point.feature;
        measured += 1u;
    }
    workgroupBarrier();
    var closest = best;
    for (var k = first; k < end; k += 1u) {
        let facet = pairs[k] / WORKGROUP;
        let found = measurements[k - first];
        if pairs[k] % WORKGROUP == local && is_closer(found.w, facet, closest) {
            closest = Closest(found.w, facet, ClosestPoint(found.xyz, features[k - first]));
        }
    }
    points[local].w = closest.distance;
    closest_so_far[local] = closest.facet;
    workgroupBarrier();
    return closest;
}

// Takes x for this invocation's point, to which nothing farther than `within` matters; that is below zero where there
// is no point. For all invocations together.
fn take_point(x: vec3<real>, within: real, local: u32) {
    workgroupBarrier();
    points[local] = vec4<real>(x, select(within, -FAR_AWAY, within < 0.0));
    closest_so_far[local] = ABSENT;
    if local == 0u {
        atomicStore(&with_point, 0u);
        atomicStore(&waiting, 0u);
        atomicStore(&near_facets, 0u);
    }
    workgroupBarrier();
    if within >= 0.0 {
        atomicOr(&with_point, 1u << local);
    }
    workgroupBarrier();
}

// The facet closest to the point that was taken, if there is one that matters. Facet `likely`, where there is one, is
// measured first. No facet has left its place at rest by more than `moved`. For all invocations together.
fn closest_facet(moved: real, likely: u32, local: u32) -> Closest {
    if likely != ABSENT {
        need(likely);
        pairs[atomicAdd(&waiting, 1u)] = likely * WORKGROUP + local;
    }
    let clusters = select(max(parameters.leaves / CLUSTER, 1u), 0u, atomicLoad(&with_point) == 0u);
    let leaves = min(parameters.leaves, CLUSTER);
    var best = none_within(points[local].w);
    // Cluster, and first leaf of it, that come next; a run of WORKGROUP clusters is looked at together.
    var cluster = 0u;
    var leaf = 0u;
    // Facets that are listed, and how many of them were looked at.
    var count = 0u;
    var looked = 0u;
    var is_begun = false;
    make_ready(local);
    loop {
        workgroupBarrier();
        let pairs_waiting = atomicLoad(&waiting);
        workgroupBarrier();
        // Pairs are measured once there are so many; the first ones, with likely facets, and the last ones at once.
        let is_between = is_begun && (looked < count || cluster < clusters);
        if pairs_waiting >= select(1u, WORKGROUP, is_between) {
            let first = max(pairs_waiting, WORKGROUP) - WORKGROUP;
            best = measure(first, pairs_waiting, best, local);
            passes += 1u + WORKGROUP + PASSES_TO_MEASURE;
            if local == 0u {
                atomicStore(&waiting, first);
            }
            continue;
        }
        if looked < count {
            if looked + local < count {
                add_pairs(facets[looked + local].x, facets[looked + local].y);
            }
            looked += WORKGROUP;
            passes += 1u + WORKGROUP;
            continue;
        }
        if cluster >= clusters {
            break;
        }
        if local == 0u {
            atomicStore(&near_facets, 0u);
        }
        workgroupBarrier();
        // Until the spheres of all clusters were looked at, or more facets might not fit.
        while cluster < clusters && atomicLoad(&near_facets) <= FACETS_TOGETHER - WORKGROUP {
            workgroupBarrier();
            if leaf == 0u && cluster % WORKGROUP == 0u {
                let own = cluster + local;
                near[local] = 0u;
                if own < clusters {
                    near[local] = points_near(surface[clusters + own], atomicLoad(&with_point), moved);
                }
                workgroupBarrier();
                passes += 2u * WORKGROUP;
            }
            let mask = near[cluster % WORKGROUP];
            passes += 2u + countOneBits(mask);
            if mask != 0u && leaf + local < leaves {
                list_facet(cluster * leaves + leaf + local, mask, moved);
            }
            leaf += WORKGROUP;
            if mask == 0u || leaf >= leaves {
                leaf = 0u;
                cluster += 1u;
                while cluster % WORKGROUP != 0u && near[cluster % WORKGROUP] == 0u {
                    cluster += 1u;
                }
            }
            workgroupBarrier();
        }
        count = atomicLoad(&near_facets);
        looked = 0u;
        is_begun = true;
        make_ready(local);
    }
    formed = ABSENT;
    return best;
}
