// Binary searches in ascending series of numbers.
//
// A shader that uses this part declares `fn ascending(series: u32, i: u32) -> f32`, which reads number `i` of
// a series. WGSL functions take no storage buffers as parameters, so the shader says which buffer holds a
// series.

// The interval k in [0, count) with ascending(first + k) <= x < ascending(first + k + 1). The first interval
// also serves smaller x, the last one larger x.
fn find_interval(series: u32, first: u32, count: u32, x: f32) -> u32 {
    var low = 0u;
    var high = count;
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if ascending(series, first + middle) <= x {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

// A place in a distribution: an interval, and the position in it from 0 to 1.
struct Place {
    interval: u32,
    within: f32,
}

// Inverts a distribution of `count` intervals, given by its running shares from 0 to 1, at `x` in [0, 1).
fn find_place(series: u32, first: u32, count: u32, x: f32) -> Place {
    let interval = find_interval(series, first, count, x);
    let begin = ascending(series, first + interval);
    let width = ascending(series, first + interval + 1u) - begin;
    return Place(interval, select(0.5, clamp((x - begin) / width, 0.0, 1.0), width > 0.0));
}
