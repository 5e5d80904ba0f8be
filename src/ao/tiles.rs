//! Sets of tiles and bricks on the host, and how they spread from level to level.

use std::ops::Range;

/// Flags of an entry of a work list; the rest is the index. Twin: `shaders/common/tiles.wgsl`.
pub(super) const MUST: u32 = 1 << 31;
pub(super) const CLEAR: u32 = 1 << 30;

/// Most tiles of a grid, so that an index leaves room for the flags.
pub(super) const MOST_TILES: u64 = 1 << 30;

/// For each place along an axis, a range of places along the same axis of another grid. Both ends ascend.
pub(super) type Spans = Vec<Range<u32>>;

/// A set of places on a grid, x fastest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TileSet {
    dims: [u32; 3],
    items: Vec<bool>,
}

impl TileSet {
    /// No place of the grid.
    pub fn empty(dims: [u32; 3]) -> Self {
        Self { dims, items: vec![false; dims.iter().map(|&n| n as usize).product()] }
    }

    /// Every place of the grid.
    pub fn full(dims: [u32; 3]) -> Self {
        Self { dims, items: vec![true; dims.iter().map(|&n| n as usize).product()] }
    }

    /// The places whose index fulfils `holds`.
    pub fn of(dims: [u32; 3], holds: impl Fn(usize) -> bool) -> Self {
        Self { dims, items: (0..dims.iter().map(|&n| n as usize).product()).map(holds).collect() }
    }

    /// Places along x, y, z.
    pub fn dims(&self) -> [u32; 3] {
        self.dims
    }

    /// Whether a place is in the set, by its index.
    pub fn has(&self, index: usize) -> bool {
        self.items[index]
    }

    /// Number of places in the set.
    pub fn count(&self) -> u64 {
        self.items.iter().map(|&item| u64::from(item)).sum()
    }

    /// One byte for each place, 0 or 1.
    pub fn bytes(&self) -> Vec<u8> {
        self.items.iter().map(|&item| u8::from(item)).collect()
    }

    pub(super) fn insert_all(&mut self, other: &Self) {
        self.combine(other, |mine, theirs| mine || theirs);
    }

    pub(super) fn keep_only(&mut self, other: &Self) {
        self.combine(other, |mine, theirs| mine && theirs);
    }

    /// The places that are in one of two sets and not in the other.
    pub(super) fn difference(&self, other: &Self) -> Self {
        let mut result = self.clone();
        result.combine(other, |mine, theirs| mine != theirs);
        result
    }

    fn combine(&mut self, other: &Self, operation: impl Fn(bool, bool) -> bool) {
        debug_assert_eq!(self.dims, other.dims, "sets on different grids");
        for (mine, &theirs) in self.items.iter_mut().zip(&other.items) {
            *mine = operation(*mine, theirs);
        }
    }

    /// Indices of the places in the set, ascending.
    pub(super) fn indices(&self) -> impl Iterator<Item = usize> {
        self.items.iter().enumerate().filter(|(_, item)| **item).map(|(index, _)| index)
    }

    pub(super) fn remove(&mut self, index: usize) {
        self.items[index] = false;
    }

    /// The set on another grid of the places whose spans, one along each axis, meet this set.
    pub(super) fn spread(&self, spans: &[Spans; 3]) -> Self {
        let mut dims = self.dims.map(|n| n as usize);
        let mut items = self.items.clone();
        for (axis, spans) in spans.iter().enumerate() {
            let stride: usize = dims[..axis].iter().product();
            let (count, blocks) = (dims[axis], dims[axis + 1..].iter().product::<usize>());
            let mut next = vec![false; stride * spans.len() * blocks];
            // Items before each place of a line.
            let mut before = vec![0_u32; count + 1];
            for block in 0..blocks {
                for line in 0..stride {
                    for i in 0..count {
                        before[i + 1] = before[i] + u32::from(items[(block * count + i) * stride + line]);
                    }
                    for (i, span) in spans.iter().enumerate() {
                        let any = before[span.end as usize] > before[span.start as usize];
                        next[(block * spans.len() + i) * stride + line] = any;
                    }
                }
            }
            dims[axis] = spans.len();
            items = next;
        }
        Self { dims: dims.map(|n| n as u32), items }
    }
}

/// The other direction: for each of `count` places that spans may name, the places whose spans name it.
pub(super) fn inverted(spans: &Spans, count: u32) -> Spans {
    (0..count)
        .map(|place| {
            let start = spans.partition_point(|span| span.end <= place) as u32;
            let end = spans.partition_point(|span| span.start <= place) as u32;
            start..end.max(start)
        })
        .collect()
}
