//! The version of the dynamics that a run needs.

use super::Physics;
use crate::config::{Bonds, Disordered, End, Profile, StiffnessRule};

impl Physics {
    /// The first version of the dynamics that gives the bits of this run as it is asked for today.
    ///
    /// Version 3 differs from version 2 in three kinds of runs: a step is made in pieces where a drive has a knot in it;
    /// the contact that closes a ring follows the rule of the chain's contacts; disorder of radii reaches the walls.
    pub(super) fn first_kernel(&self) -> u32 {
        let is_newer = self.has_knots() || self.has_closing_rule() || self.has_disordered_walls();
        if is_newer { 3 } else { 2 }
    }

    /// True if the steps of this run are made in pieces.
    fn has_knots(&self) -> bool {
        let end_s = self.time_s(self.step_count);
        self.drives
            .iter()
            .any(|drive| drive.waveform.knots_s().iter().any(|knot_s| (0.0..=end_s).contains(knot_s)))
    }

    /// True if it is a ring with a rule that tells its contacts apart.
    fn has_closing_rule(&self) -> bool {
        let is_even = |profile: &Profile| matches!(profile, Profile::Same(_));
        let mut bonds = self.bonds.iter().flat_map(Bonds::laws);
        let bonds_are_even = bonds.all(|bond| is_even(&bond.stiffness));
        let second_is_even = self.second.as_ref().is_none_or(|second| is_even(&second.stiffness));
        let contacts_are_even = self.stiffnesses.is_uniform()
            && self.contacts.is_empty()
            && self.alphas.is_none()
            && self.gaps_m.is_none()
            && self.disorder.iter().all(|disorder| disorder.of == Disordered::Masses);
        self.ends.left == End::Periodic && !(bonds_are_even && second_is_even && contacts_are_even)
    }

    /// True if a wall touches a sphere of a radius that disorder has changed, or seemed to change by its mass.
    fn has_disordered_walls(&self) -> bool {
        let by_radii = self.spheres.is_some() || self.stiffnesses == StiffnessRule::Radii;
        by_radii && !self.disorder.is_empty() && [self.ends.left, self.ends.right].contains(&End::Fixed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::RunConfig;

    fn physics(toml: &str) -> Physics {
        Physics::resolve(&RunConfig::from_toml(toml).expect("a configuration")).expect("a run")
    }

    fn chain(beads: u64, more: &str) -> String {
        format!(
            "[time]\nduration_s = 2e-4\n[striker]\nbead = 0\nvelocity_m_s = 1e-3\n[chain]\nbeads = {beads}\n{more}"
        )
    }

    const PLAIN: &str = "bead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n";
    const RING: &str = "[ends]\nleft = \"periodic\"\nright = \"periodic\"\n";
    const PRESSED_RING: &str =
        "[ends]\nleft = \"periodic\"\nright = \"periodic\"\n[load]\nprecompression_n = 1000.0\n";

    #[test]
    fn a_drag_of_0_is_no_loss() {
        let is_without_loss = |more: &str| physics(&chain(10, &format!("{PLAIN}{more}"))).is_without_loss();
        let drag = |list: &str| is_without_loss(&format!("[on_site]\ndrag_n_s_per_m = {list}\n"));
        assert!(is_without_loss("") && drag("0.0") && !drag("{ pattern = [0.0, 1e-3] }"));
        assert!(!is_without_loss("[ends]\nright = \"absorbing\"\n"));
    }

    #[test]
    fn a_run_has_the_first_version_that_gives_its_bits() {
        let version = |more: &str| physics(&chain(10, &format!("{PLAIN}{more}"))).kernel_version;
        let ring_of = |stiffnesses: &str| version(&format!("{stiffnesses}{RING}"));
        let drive = |waveform: &str| version(&format!("[[drive]]\nbead = 3\nforce_n = {{ {waveform} }}\n"));
        assert_eq!((version(""), ring_of(""), ring_of("gaps_m = 1e-6\n")), (2, 2, 3));
        assert_eq!(ring_of("stiffnesses = \"radii\"\n"), 3);
        assert_eq!(drive("sine = { amplitude = 1.0, frequency_hz = 900.0 }"), 2);
        assert_eq!(drive("sine = { amplitude = 1.0, frequency_hz = 900.0, ramp_s = 1e-4 }"), 3);
        assert_eq!(drive("step = { amplitude = 1.0, at_s = 1.0 }"), 2, "after the end of the run");
    }

    /// Equal spheres in a ring are joined by equal contacts: with the formula of a wall the last would be √2 stiffer.
    #[test]
    fn the_contact_that_closes_a_ring_is_one_of_its_contacts() {
        let ring = physics(&chain(10, &format!("{PLAIN}stiffnesses = \"radii\"\n{PRESSED_RING}"))).chain();
        assert!(ring.stiffness.iter().all(|k| *k == ring.walls.left.stiffness), "{:?}", ring.walls.left);
        assert_eq!(ring.walls.left.rest_overlap_m, ring.rest_overlap_m[0]);
        let pattern = "stiffnesses = { pattern = [2e7, 4e7] }\n";
        let dimer = physics(&chain(10, &format!("{PLAIN}{pattern}{PRESSED_RING}"))).chain();
        assert_eq!((dimer.stiffness.len(), dimer.stiffness[8], dimer.walls.left.stiffness), (9, 2e7, 4e7));
        let alphas = "alphas = { pattern = [1.5, 3.0] }\n";
        let dimer = physics(&chain(4, &format!("{PLAIN}{alphas}{PRESSED_RING}"))).chain();
        assert_eq!((dimer.walls.left.stiffness, dimer.terms[0].wall_stiffness), (0.0, [1e7, 0.0]));
        assert!((dimer.walls.left.rest_force_n / 1000.0 - 1.0).abs() < 1e-12);
        let bonds = "bonds = { linear = { list = [1.0, 2.0, 3.0] } }\nbead_mass_kg = 1.0\n";
        let bonded = physics(&chain(3, &format!("{bonds}{RING}"))).chain();
        assert_eq!(
            (&bonded.terms[0].stiffness[..], bonded.terms[0].wall_stiffness[0]),
            (&[1.0, 2.0][..], 3.0)
        );
        let disordered = "seed = 7\n[[disorder]]\nof = \"stiffnesses\"\nuniform = 0.2\n";
        let ring = physics(&format!("{disordered}{}", chain(5, &format!("{PLAIN}{RING}")))).chain();
        assert!((ring.walls.left.stiffness / 1e7 - 1.0).abs() > 1e-3, "{:?}", ring.walls.left);
        let odd = "contacts = [{ contact = 4, stiffness = 3e7 }]\n";
        assert_eq!(physics(&chain(5, &format!("{PLAIN}{odd}{RING}"))).chain().walls.left.stiffness, 3e7);
    }

    /// Spheres of twice the radius touch a wall with √2 of the stiffness.
    #[test]
    fn disorder_of_radii_reaches_the_walls() {
        let spheres = |factor: f64| {
            let disorder = format!(
                "[[disorder]]\nof = \"radii\"\ntwo_valued = {{ fraction = 1.0, factor = {factor:?} }}\n"
            );
            let walls = "[ends]\nleft = \"fixed\"\nright = \"fixed\"\n";
            let beads = "spheres = { material = \"steel\", radius_m = 5e-3 }\n";
            physics(&chain(4, &format!("{beads}{walls}{disorder}"))).chain()
        };
        let (usual, large) = (spheres(1.0), spheres(2.0));
        for side in [0, 1] {
            let ratio = large.wall(side).stiffness / usual.wall(side).stiffness;
            assert!((ratio - 2.0_f64.sqrt()).abs() < 1e-12, "{ratio}");
        }
    }

    #[test]
    fn a_list_for_a_ring_has_a_number_for_its_last_contact() {
        let ring = chain(4, &format!("{PLAIN}stiffnesses = {{ list = [1e7, 2e7, 3e7] }}\n{RING}"));
        let error =
            Physics::resolve(&RunConfig::from_toml(&ring).expect("a configuration")).expect_err("too few");
        assert!(error.to_string().contains("4 values"), "{error}");
    }
}
