//! The ends of a chain, and the drag of absorbing ones.

use super::check::check_positive;
use super::{Physics, usize_of};
use crate::config::{ConfigError, End};

impl Physics {
    pub(super) fn check_ends(&self) -> Result<(), ConfigError> {
        let ends = &self.ends;
        let sides = [("left", ends.left, ends.right), ("right", ends.right, ends.left)];
        if let (End::Periodic, Some(stiffness), 3..) = (ends.right, ends.right_stiffness, self.kernel_version)
        {
            let allowed = "nothing in a ring, whose ends are one contact: chain.contacts, with the number of the last bead";
            return Err(ConfigError::number("ends.right_stiffness", stiffness, allowed));
        }
        if let Some((side, ..)) =
            sides.iter().find(|(_, this, other)| *this == End::Periodic && this != other)
        {
            let allowed = "left = \"periodic\" and right = \"periodic\": the last bead touches the first one";
            return Err(ConfigError::value(&format!("ends.{side}"), "periodic at one end", allowed));
        }
        if ends.left == End::Periodic && self.beads < 3 {
            return Err(ConfigError::value("chain.beads", self.beads, "3 beads or more in a ring"));
        }
        let is_absorbing = [ends.left, ends.right].contains(&End::Absorbing);
        let beads = ends.absorbing_beads.map(|beads| beads as f64);
        for (key, number) in [
            ("ends.absorbing_beads", beads),
            ("ends.absorbing_drag_n_s_per_m", ends.absorbing_drag_n_s_per_m),
        ] {
            if let (Some(number), false) = (number, is_absorbing) {
                return Err(ConfigError::number(key, number, "left or right = \"absorbing\" with it"));
            }
        }
        if let Some(beads) = ends.absorbing_beads
            && !(1..=self.beads).contains(&beads)
        {
            let allowed = format!("1 to {} beads of this chain", self.beads);
            return Err(ConfigError::value("ends.absorbing_beads", beads, &allowed));
        }
        if let Some(drag) = ends.absorbing_drag_n_s_per_m {
            check_positive("ends.absorbing_drag_n_s_per_m", drag, "N·s/m")?;
        }
        Ok(())
    }

    /// The drag of each bead (N·s/m): the drag asked for, and at an absorbing end one that grows with the cube of the way into it.
    pub(super) fn drags(&self) -> Vec<f64> {
        let beads = usize_of(self.beads);
        let mut drag =
            self.on_site.drag_n_s_per_m.as_ref().map_or(vec![0.0; beads], |drag| drag.values(beads));
        let most = self.absorbing_drag_n_s_per_m();
        let depth = self.absorbing_beads();
        for (end, from) in [(self.ends.left, 0), (self.ends.right, beads - 1)] {
            if end != End::Absorbing {
                continue;
            }
            for way in 0..depth {
                let bead = if from == 0 { way } else { from - way };
                let part = (depth - way) as f64 / depth as f64;
                drag[bead] += most * (part * part * part);
            }
        }
        drag
    }

    /// Beads with drag at an absorbing end.
    pub(super) fn absorbing_beads(&self) -> usize {
        let usual = (self.beads / 5).clamp(1, 100); // integers
        usize_of(self.ends.absorbing_beads.unwrap_or(usual))
    }

    /// The drag (N·s/m) of the bead at an absorbing end: by default half of `m/T` where contacts are loaded or bonds, so that a wave dies out on its way
    /// there and back. Where beads are loose, 1/200 of `m/T`: the last of them carry the energy away, as from a free end, and are slowed down then.
    /// A strong drag on the way would send back more than it takes.
    pub fn absorbing_drag_n_s_per_m(&self) -> f64 {
        let is_loose = self.load.is_none() && self.bonds.is_none();
        let part = if is_loose { 0.005 } else { 0.5 };
        let usual = || part * self.bead_mass_kg / self.scales().time_s;
        self.ends.absorbing_drag_n_s_per_m.unwrap_or_else(usual)
    }
}
