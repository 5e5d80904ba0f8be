//! Edits as users make them, at random.

use spao_server::renderer::Coverage;
use spao_server::scene::{ControlPoint, Rgb, TransferFunction};

use super::{GAP, Random, State};

/// What an edit changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    Opacity,
    Value,
    Window,
    Color,
    Scale,
    Unused,
    Off,
    Undo,
    Factor,
    Coverage,
    Nudge,
}

impl Kind {
    pub(super) const ALL: [Self; 11] = [
        Self::Opacity,
        Self::Value,
        Self::Window,
        Self::Color,
        Self::Scale,
        Self::Unused,
        Self::Off,
        Self::Undo,
        Self::Factor,
        Self::Coverage,
        Self::Nudge,
    ];
}

/// Somebody who edits a volume of values in `range`.
pub(super) struct Editor {
    pub(super) random: Random,
    range: [f64; 2],
    history: Vec<TransferFunction>,
    /// Place of the window that moves through the range.
    window: f64,
}

impl Editor {
    pub(super) fn new(seed: u64, range: [f64; 2]) -> Self {
        Self { random: Random(seed), range, history: Vec::new(), window: 0.0 }
    }

    fn value(&self, share: f64) -> f64 {
        self.range[0] + share * (self.range[1] - self.range[0])
    }

    /// Soft above the gap, nothing below.
    pub(super) fn usual(&self) -> TransferFunction {
        self.function(&[(0.0, 0.0), (0.2, 0.0), (0.5, 0.2), (0.7, 0.1), (1.0, 0.8)])
    }

    pub(super) fn function(&self, points: &[(f64, f64)]) -> TransferFunction {
        let point = |&(share, opacity)| self.point(share, opacity);
        TransferFunction { points: points.iter().map(point).collect(), opacity_unit_distance: None }
    }

    fn point(&self, share: f64, opacity: f64) -> ControlPoint {
        ControlPoint { value: self.value(share), color: Rgb::WHITE, opacity }
    }

    /// Changes the state in some way.
    pub(super) fn edit(&mut self, state: &mut State) -> Kind {
        let kind = Kind::ALL[self.random.below(Kind::ALL.len() as u64) as usize];
        let before = state.transfer.clone();
        self.apply(kind, state);
        if state.transfer != before {
            self.history.push(before);
        }
        kind
    }

    fn apply(&mut self, kind: Kind, state: &mut State) {
        let points = &mut state.transfer.points;
        let which = self.random.below(points.len() as u64) as usize;
        match kind {
            // Often exactly nothing or everything.
            Kind::Opacity => points[which].opacity = (1.4 * self.random.share() - 0.2).clamp(0.0, 1.0),
            Kind::Value => {
                let low = which.checked_sub(1).map_or(self.range[0], |i| points[i].value);
                let high = points.get(which + 1).map_or(self.range[1], |p| p.value);
                points[which].value = low + (0.02 + 0.96 * self.random.share()) * (high - low);
            }
            Kind::Window => {
                self.window = (self.window + 0.07) % 0.9;
                let w = self.window;
                state.transfer = self.function(&[(w, 0.0), (w + 0.02, 0.9), (w + 0.08, 0.9), (w + 0.1, 0.0)]);
            }
            Kind::Color => points[which].color = Rgb([self.random.share(), 0.5, 0.25]),
            Kind::Scale => {
                let factor = 0.3 + 1.5 * self.random.share();
                points.iter_mut().for_each(|p| p.opacity = (p.opacity * factor).min(1.0));
            }
            Kind::Unused => self.change_unused(state),
            Kind::Off => {
                let off = points.iter().all(|p| p.opacity == 0.0);
                state.transfer = if off { self.usual() } else { self.function(&[(0.0, 0.0), (1.0, 0.0)]) };
            }
            Kind::Undo => {
                let Some(last) = self.history.len().checked_sub(1) else { return };
                let at = last - self.random.below(3.min(last as u64 + 1)) as usize;
                state.transfer = self.history[at].clone();
            }
            Kind::Factor => {
                let factors = [0.0, 0.5, 1.0, 2.0];
                state.settings.normal_factor = factors[self.random.below(4) as usize];
            }
            Kind::Coverage => {
                state.coverage = match state.coverage {
                    Coverage::Visible => Coverage::Everywhere,
                    Coverage::Everywhere => Coverage::Visible,
                }
            }
            Kind::Nudge => {
                let nudge = 1e-3 * (self.random.share() - 0.5);
                points[which].opacity = (points[which].opacity + nudge).clamp(0.0, 1.0);
            }
        }
    }

    /// A spike where no values are; nothing else changes.
    fn change_unused(&mut self, state: &mut State) {
        let third = (GAP[1] - GAP[0]) / 3.0;
        let (low, high) = (self.value(GAP[0] + third), self.value(GAP[1] - third));
        let (below, above) = (state.transfer.sample(low).1, state.transfer.sample(high).1);
        let point = |value, opacity| ControlPoint { value, color: Rgb::WHITE, opacity };
        let middle = point(0.5 * (low + high), self.random.share());
        let points = &mut state.transfer.points;
        points.retain(|p| p.value < low || p.value > high);
        points.extend([point(low, below), middle, point(high, above)]);
        points.sort_by(|a, b| a.value.total_cmp(&b.value));
    }
}
