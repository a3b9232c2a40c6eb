//! Why a correction is refused.

use std::fmt;

/// Why a waypoint was refused; the numbers are for programs and stay what they are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum Reason {
    /// A reading or a feature is NaN or infinite.
    NotFinite = 1,
    /// The tool cannot be brought to the target's position.
    PositionNotReached = 2,
    /// It cannot be turned to the target's orientation.
    OrientationNotReached = 3,
    /// A corrected joint is beyond its limits.
    JointLimit = 4,
    /// A joint would change by too much.
    JointCorrection = 5,
    /// The tool would be shifted by too much.
    Shift = 6,
    /// The tool would be turned by too much.
    Turn = 7,
    /// The calibration knows too little there.
    Spread = 8,
    /// The shift changes too fast along the path.
    ShiftChange = 9,
    /// The turn changes too fast along the path.
    TurnChange = 10,
    /// The solution belongs to another branch of the arm than its seed.
    Branch = 11,
}

/// A refused waypoint: what was found and what is allowed, m and rad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refusal {
    /// Why.
    pub reason: Reason,
    /// Joint from 1, where it is one joint's matter, else 0.
    pub joint: usize,
    /// What was found.
    pub value: f64,
    /// What is allowed; of joint limits the one that was passed.
    pub limit: f64,
    /// Whether that joint slides, so that `value` is a length.
    pub slides: bool,
}

impl Refusal {
    pub(crate) fn new(reason: Reason, value: f64, limit: f64) -> Self {
        Self { reason, joint: 0, value, limit, slides: false }
    }

    /// Where there is nothing to compare.
    pub(crate) fn plain(reason: Reason) -> Self {
        Self::new(reason, f64::NAN, f64::NAN)
    }

    /// Unless the value is known to be within its limit.
    pub(crate) fn above(reason: Reason, value: f64, limit: f64) -> Option<Self> {
        if value <= limit { None } else { Some(Self::new(reason, value, limit)) }
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (value, limit, joint) = (self.value, self.limit, self.joint);
        let unit = if self.slides { MM } else { DEG };
        match self.reason {
            Reason::NotFinite => write!(out, "a reading is not a finite number"),
            Reason::PositionNotReached => {
                write!(out, "the tool stays {} mm from its target{FAR}", in_thousandths(value))
            }
            Reason::OrientationNotReached => {
                write!(out, "the tool stays turned {} mrad from its target{FAR}", in_thousandths(value))
            }
            Reason::JointLimit => {
                write!(out, "joint {joint} would be at {}, its limit is {}", unit.of(value), unit.of(limit))
            }
            Reason::JointCorrection => above(out, &format!("joint {joint} would change"), unit, self),
            Reason::Shift => above(out, "the correction shifts the tool", MM, self),
            Reason::Turn => above(out, "the correction turns the tool", DEG, self),
            Reason::Spread if value.is_nan() => write!(
                out,
                "the calibration has no standard deviation to compare with the {} that are allowed: infinity switches \
                 the bound off",
                MM.of(limit)
            ),
            Reason::Spread => above(out, "the calibration is uncertain (one standard deviation)", MM, self),
            Reason::ShiftChange => {
                above(out, "over the way from the waypoint before, the shift changes", MM, self)
            }
            Reason::TurnChange => {
                above(out, "over the way from the waypoint before, the turn changes", DEG, self)
            }
            Reason::Branch => write!(out, "the solution lies on another branch of the arm than its seed"),
        }
    }
}

/// A thousand times a value, in powers of ten where it would be zero.
fn in_thousandths(value: f64) -> String {
    let shown = 1e3 * value;
    if shown < 1e-3 { format!("{shown:.1e}") } else { format!("{shown:.4}") }
}

/// What makes a target unreachable.
const FAR: &str = ": the configuration is singular or nearly so, or the target out of reach";
const MM: Unit = Unit { name: "mm", per_si: 1e3 };
const DEG: Unit = Unit { name: "deg", per_si: 180.0 / std::f64::consts::PI };

/// A unit to show a number in.
#[derive(Clone, Copy)]
struct Unit {
    name: &'static str,
    per_si: f64,
}

impl Unit {
    fn of(self, value: f64) -> String {
        format!("{:.4} {}", value * self.per_si, self.name)
    }
}

fn above(out: &mut fmt::Formatter<'_>, what: &str, unit: Unit, refusal: &Refusal) -> fmt::Result {
    write!(out, "{what} by {}, at most {} are allowed", unit.of(refusal.value), unit.of(refusal.limit))
}
