//! Drives that a run may have.

use super::Physics;
use crate::config::{ConfigError, End};
use crate::drive::{Place, Quantity, Side};
use std::collections::{BTreeSet, HashMap};

/// Smallest number of steps in the shortest period of a drive.
const STEPS_OF_PERIOD: f64 = 20.0;

impl Physics {
    pub(super) fn check_drives(&self) -> Result<(), ConfigError> {
        if self.drives.len() as u64 > self.beads / 2 {
            let allowed = format!("at most {} drives: one for each two beads", self.beads / 2);
            return Err(ConfigError::value("drive", format!("{} drives", self.drives.len()), &allowed));
        }
        let strikers = std::iter::once(&self.striker).chain(&self.strikers);
        let struck: BTreeSet<u64> =
            strikers.filter(|striker| striker.velocity_m_s != 0.0).map(|striker| striker.bead).collect();
        let mut places = HashMap::new();
        for (i, drive) in self.drives.iter().enumerate() {
            let key = format!("drive[{i}]");
            // its numbers decide the step, on which the rest of what is checked depends
            drive.check(&key, 0.0)?;
            match drive.at {
                Place::Bead(bead) => self.check_bead(&format!("{key}.bead"), bead)?,
                Place::Wall(side) => {
                    let end = if side == Side::Left { self.ends.left } else { self.ends.right };
                    if end != End::Fixed {
                        let allowed =
                            format!("a wall that is there: {side} = \"fixed\" in [ends]; or bead = …");
                        return Err(ConfigError::value(&format!("{key}.wall"), side, &allowed));
                    }
                    if drive.prescribes == Quantity::Force {
                        let allowed = "displacement_m or velocity_m_s of a wall; force_n of a bead";
                        return Err(ConfigError::value(
                            &format!("{key}.force_n"),
                            "a force on a wall",
                            allowed,
                        ));
                    }
                }
            }
            if let Some(other) = places.insert(drive.at, i) {
                let allowed = format!("one drive at a place; drive[{other}] is at {} already", drive.at);
                return Err(ConfigError::value(&key, format!("another drive at {}", drive.at), &allowed));
            }
            let is_struck = matches!(drive.at, Place::Bead(bead) if struck.contains(&bead));
            if drive.prescribes != Quantity::Force && is_struck {
                let allowed = "a bead that is not struck: its motion is prescribed";
                return Err(ConfigError::value(&format!("{key}.bead"), drive.at, allowed));
            }
        }
        Ok(())
    }

    /// Checks the drives against the duration and the time step of the run.
    pub(super) fn check_drive_times(&self) -> Result<(), ConfigError> {
        for (i, drive) in self.drives.iter().enumerate() {
            let key = format!("drive[{i}]");
            drive.check(&key, self.time_s(self.step_count))?;
            let Some(hz) = drive.waveform.highest_hz() else { continue };
            let steps = 1.0 / (hz * self.dt_s);
            if steps < STEPS_OF_PERIOD {
                let key = format!("{key}.{}", drive.prescribes.key());
                let found = format!("{hz} Hz, a period of {steps:.3} steps");
                let longest_s = 1.0 / (STEPS_OF_PERIOD * hz);
                let allowed = format!(
                    "a period of at least {STEPS_OF_PERIOD} steps: time.dt_s of at most {longest_s:.3e} s, or a lower frequency"
                );
                return Err(ConfigError::value(&key, found, &allowed));
            }
        }
        Ok(())
    }
}
