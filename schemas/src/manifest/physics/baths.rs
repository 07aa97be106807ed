//! Heat baths that a run may have.

use super::Physics;
use super::check::check_positive;
use crate::bath::MOST_FRICTION;
use crate::config::ConfigError;
use crate::drive::{Place, Quantity};

/// The largest whole number up to which doubles, and so the numbers of JSON, have all.
const MOST_SEED: u64 = (1 << 53) - 1;

impl Physics {
    /// Checks each bath by itself, and that no bead is in two of them or moved by a drive.
    pub(super) fn check_baths(&self) -> Result<(), ConfigError> {
        let mut rows = Vec::new();
        for (i, bath) in self.baths.iter().enumerate() {
            let key = format!("bath[{i}]");
            bath.check(&key, 0.0)?;
            check_positive(&format!("{key}.friction_per_s"), bath.friction_per_s, "1/s")?;
            if bath.seed.unwrap_or(self.seed) > MOST_SEED {
                let key = if bath.seed.is_some() { format!("{key}.seed") } else { "seed".to_owned() };
                let allowed = "a seed of a bath up to 2^53 − 1, which JSON keeps";
                return Err(ConfigError::value(&key, bath.seed.unwrap_or(self.seed), allowed));
            }
            let beads = bath.beads.range();
            if bath.beads.counted(self.beads) != bath.beads || bath.beads.of(self.beads).is_err() {
                let allowed =
                    format!("beads of this chain, 0 to {}: such as \"0..4\" or \"-4..\"", self.beads - 1);
                return Err(ConfigError::value(&format!("{key}.beads"), bath.beads, &allowed));
            }
            if bath.pairs && beads.len() < 2 {
                let allowed = "two beads or more: a bath of pairs acts between neighbours";
                return Err(ConfigError::value(&format!("{key}.beads"), bath.beads, allowed));
            }
            rows.push((beads, i));
        }
        rows.sort_by_key(|(beads, _)| beads.start);
        for pair in rows.windows(2) {
            let [(one, first), (two, second)] = pair else { continue };
            if one.end > two.start {
                let found = format!("bead {}, which is in bath[{first}], too", two.start);
                return Err(ConfigError::value(
                    &format!("bath[{second}].beads"),
                    found,
                    "each bead in one bath",
                ));
            }
        }
        for (d, drive) in self.drives.iter().enumerate() {
            let Place::Bead(bead) = drive.at else { continue };
            // rows are in order, and none meets another
            let behind = rows.partition_point(|(beads, _)| beads.start as u64 <= bead);
            let row = rows[..behind].last().filter(|(beads, _)| bead < beads.end as u64);
            if let (Some((_, i)), true) = (row, drive.prescribes != Quantity::Force) {
                let found = format!("bead {bead}, which drive[{d}] moves");
                let allowed = "beads whose motion is not prescribed";
                return Err(ConfigError::value(&format!("bath[{i}].beads"), found, allowed));
            }
        }
        Ok(())
    }

    /// Checks the baths against the duration and the time step of the run.
    pub(super) fn check_frictions(&self) -> Result<(), ConfigError> {
        for (i, bath) in self.baths.iter().enumerate() {
            let key = format!("bath[{i}]");
            bath.check(&key, self.time_s(self.step_count))?;
            let product = bath.friction_per_s * self.dt_s;
            if product > MOST_FRICTION {
                let found = format!("{:e} with friction times dt = {product:.3}", bath.friction_per_s);
                let allowed = format!(
                    "friction times dt of at most {MOST_FRICTION}: time.dt_s of at most {:.3e} s, or less friction",
                    MOST_FRICTION / bath.friction_per_s
                );
                return Err(ConfigError::value(&format!("{key}.friction_per_s"), found, &allowed));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use crate::config::RunConfig;
    use crate::manifest::Physics;

    const CHAIN: &str = "[chain]\nbeads = 8\nbead_mass_kg = 1.0\nbonds = { linear = 1.0 }\n[ends]\nleft = \"fixed\"\n[time]\nduration_s = 10.0\n";

    fn refused(more: &str) -> String {
        let text = format!("{CHAIN}{more}\n");
        let found = RunConfig::from_toml(&text).and_then(|config| Physics::resolve(&config));
        found.expect_err(more).to_string()
    }

    #[test]
    fn impossible_baths_are_refused_with_their_keys() {
        let bath =
            |keys: &str| refused(&format!("[[bath]]\nfriction_per_s = 0.1\ntemperature_j = 1.0\n{keys}"));
        for (keys, words) in [
            ("beads = 8", "bath[0].beads"),
            ("beads = \"-9..\"", "beads of this chain, 0 to 7"),
            ("beads = \"4..4\"", "bath[0].beads"),
            ("beads = 3\npairs = true", "two beads or more"),
            (
                "beads = \"..4\"\n[[bath]]\nbeads = 3\nfriction_per_s = 1.0\ntemperature_k = 300",
                "in bath[0], too",
            ),
            ("[[drive]]\nbead = 2\nvelocity_m_s = 1.0", "which drive[0] moves"),
            ("temperature_k = 300", "one of temperature_j"),
            ("seed = 9007199254740992", "bath[0].seed"),
            ("[damping]\nviscous_n_s_per_m = 1.0", "found [[bath]] beside [damping]; allowed: one of them"),
            ("[integrator]\nmethod = \"gear5\"", "integrator.method"),
            ("noise = 1", "unknown key `noise`"),
        ] {
            let error = bath(keys);
            assert!(error.contains(words), "{keys}: {error}");
        }
        for (keys, words) in [
            ("friction_per_s = -1.0\ntemperature_j = 1.0", "bath[0].friction_per_s"),
            ("friction_per_s = 1.0\ntemperature_j = -1.0", "0 or more at all times"),
            (
                "friction_per_s = 1.0\ntemperature_j = { step = { amplitude = -1.0, at_s = 0.0 } }",
                "found step of -1 J at 0 s; allowed",
            ),
            (
                "friction_per_s = 1.0\ntemperature_j = { sine = { amplitude = 1.0, frequency_hz = 1.0 } }",
                "0 or more",
            ),
            ("friction_per_s = 1.0\ntemperature_j = nan", "bath[0].temperature_j"),
            ("friction_per_s = 1.0", "neither"),
            ("friction_per_s = 1.0\ntemperature_j = 0.0", "only zeros"),
        ] {
            let error = refused(&format!("[[bath]]\n{keys}"));
            assert!(error.contains(words), "{keys}: {error}");
        }
        let coarse = CHAIN.replace("10.0", "10.0\ndt_s = 0.1");
        let text = format!("{coarse}[[bath]]\nfriction_per_s = 6.0\ntemperature_j = 1.0\n");
        let error =
            Physics::resolve(&RunConfig::from_toml(&text).expect("a configuration")).expect_err("too coarse");
        assert!(
            error.to_string().contains("bath[0].friction_per_s") && error.to_string().contains("8.333e-2 s"),
            "{error}"
        );
    }
}
