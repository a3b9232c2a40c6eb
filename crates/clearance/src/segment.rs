//! Distances between straight segments.

/// Square of what two segments span, m^4; of less they count as parallel.
const PARALLEL: f64 = 1e-12;
/// Square of a length, m^2; of less a segment counts as a point.
const POINT: f64 = 1e-12;

/// Distance between the segments from `begin` along `along`, and from `top` along `down`; without a length they are points.
///
/// Ericson, Real-Time Collision Detection, 2005, section 5.1.9.
pub fn distance(begin: [f64; 3], along: [f64; 3], top: [f64; 3], down: [f64; 3]) -> f64 {
    let apart = minus(begin, top);
    let (aa, bb, ab) = (dot(along, along), dot(down, down), dot(along, down));
    let (to_a, to_b) = (dot(along, apart), dot(down, apart));
    let crossing = aa * bb - ab * ab;
    // Of segments that are parallel any place of the first one will do to begin with.
    let s = ((ab * to_b - to_a * bb) / crossing.max(PARALLEL)).clamp(0.0, 1.0);
    let t = ((ab * s + to_b) / bb.max(POINT)).clamp(0.0, 1.0);
    let s = ((ab * t - to_a) / aa.max(POINT)).clamp(0.0, 1.0);
    let nearest = [0, 1, 2].map(|i| apart[i] + s * along[i] - t * down[i]);
    dot(nearest, nearest).sqrt()
}

/// a - b.
pub fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// a + b.
pub fn plus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// a . b.
pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
