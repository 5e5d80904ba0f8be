//! Where there is something to see: the map that lets rays leap over empty bricks.

/// Chebyshev distance, in bricks, from every brick to the next visible one: 0 for a visible brick, at most 255.
/// `dims` are bricks along x (fastest), y, z.
///
/// Separable: the distance is the least, over bricks along one axis, of the larger of their distance and
/// what the axes before left, so two sweeps per axis suffice.
pub fn brick_distance(dims: [u32; 3], visible: impl Fn(usize) -> bool) -> Vec<u8> {
    let [nx, ny, nz] = dims.map(|n| n as usize);
    let mut distance: Vec<u8> = (0..nx * ny * nz).map(|b| if visible(b) { 0 } else { u8::MAX }).collect();
    let mut line = Vec::new();
    for (count, stride) in [(nx, 1), (ny, nx), (nz, nx * ny)] {
        let starts = (0..distance.len()).filter(|i| i / stride % count == 0);
        for start in starts.collect::<Vec<_>>() {
            line.clear();
            line.extend((0..count).map(|i| distance[start + i * stride]));
            for i in 0..count {
                distance[start + i * stride] = least_along(&line, i);
            }
        }
    }
    distance
}

/// min over j of max(|i - j|, line[j]).
fn least_along(line: &[u8], i: usize) -> u8 {
    let mut best = line[i];
    let reach = line.len();
    for step in 1..reach {
        // Nothing farther than the best so far can be better.
        if step >= usize::from(best) {
            break;
        }
        let at_least = u8::try_from(step).unwrap_or(u8::MAX);
        for j in [i.checked_sub(step), Some(i + step).filter(|&j| j < reach)].into_iter().flatten() {
            best = best.min(line[j].max(at_least));
        }
    }
    best
}
