//! Inputs of other programs: their own scripts, and the chain with the state to start from.

use super::piece::Piece;
use anyhow::Error;
use serde_json::json;
use std::f64::consts::PI;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// Every bead's in LAMMPS (m), where the chain has a place in space. It decides nothing but the rounding: with a power
/// of two the overlap of neighbours that touch is exactly 0, and the larger it is the more digits of an overlap are lost.
pub(super) const DIAMETER_M: f64 = 1.0 / 256.0;

/// Writes all inputs into `directory`.
pub(super) fn write(directory: &Path, piece: &Piece) -> Result<(), Error> {
    let files = [
        ("chain.lmp", include_str!("../../peers/chain.lmp").to_owned()),
        ("chain_numba.py", include_str!("../../peers/chain_numba.py").to_owned()),
        ("chain_numpy.py", include_str!("../../peers/chain_numpy.py").to_owned()),
        ("chain.data", lammps_data(piece)),
        ("chain.json", json(piece)),
    ];
    for (name, text) in files {
        fs::write(directory.join(name), text)?;
    }
    Ok(())
}

/// The chain for the Python programs, in SI units.
fn json(piece: &Piece) -> String {
    let physics = &piece.manifest.physics;
    let chain = json!({
        "stiffness": physics.stiffness,
        "dt_s": physics.dt_s,
        "steps": piece.steps,
        "every": piece.every,
        "mass_kg": physics.chain().mass_kg,
        "u_m": piece.start.u_m[..],
        "v_m_s": piece.start.v_m_s[..],
    });
    chain.to_string()
}

/// The chain for LAMMPS: spheres of one size that differ in density.
fn lammps_data(piece: &Piece) -> String {
    let mass_kg = piece.manifest.physics.chain().mass_kg;
    let half_count = mass_kg.len() as f64 / 2.0;
    let length_m = DIAMETER_M * mass_kg.len() as f64;
    let mut text = format!(
        "A chain of beads, units si, atom_style sphere\n\n{} atoms\n1 atom types\n\n{:?} {:?} xlo xhi\n\
         {:?} {DIAMETER_M} ylo yhi\n{:?} {DIAMETER_M} zlo zhi\n\nAtoms # sphere\n\n",
        mass_kg.len(),
        -length_m,
        length_m,
        -DIAMETER_M,
        -DIAMETER_M
    );
    // writing to a String cannot fail
    for (i, (mass_kg, u_m)) in mass_kg.iter().zip(piece.start.u_m.iter()).enumerate() {
        let density = mass_kg / (PI / 6.0 * DIAMETER_M.powi(3));
        // positions have most digits at the middle, where the motion goes on longest
        let x_m = (i as f64 - half_count) * DIAMETER_M + u_m;
        let _ = writeln!(text, "{} 1 {DIAMETER_M} {density:?} {x_m:?} 0 0", i + 1);
    }
    text.push_str("\nVelocities\n\n");
    for (i, v_m_s) in piece.start.v_m_s.iter().enumerate() {
        let _ = writeln!(text, "{} {v_m_s:?} 0 0 0 0 0", i + 1);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each reads the same state: what was written gives the bits of the displacements and velocities back, but
    /// for what LAMMPS loses where it adds the bead's place.
    #[test]
    fn inputs_hold_the_chain_and_its_state() {
        let piece = Piece::every_state().expect("a preset");
        let parsed: serde_json::Value = serde_json::from_str(&json(&piece)).expect("JSON");
        assert_eq!(parsed["u_m"], json!(piece.start.u_m[..]));
        assert_eq!(parsed["v_m_s"], json!(piece.start.v_m_s[..]));
        assert_eq!(parsed["mass_kg"][500], 0.6e-3);
        assert_eq!(parsed["steps"], 4000);

        let text = lammps_data(&piece);
        let (head, rest) = text.split_once("Atoms # sphere\n\n").expect("atoms");
        let (atoms, velocities) = rest.split_once("\nVelocities\n\n").expect("velocities");
        assert!(head.contains("1000 atoms"), "{head}");
        let numbers = |line: &str| -> Vec<f64> {
            line.split(' ').map(|word| word.parse().expect("a number")).collect()
        };
        let atoms: Vec<_> = atoms.lines().map(numbers).collect();
        let velocities: Vec<_> = velocities.lines().map(numbers).collect();
        assert_eq!((atoms.len(), velocities.len()), (1000, 1000));
        for (i, (atom, velocity)) in atoms.iter().zip(&velocities).enumerate() {
            assert_eq!((atom[0], velocity[0]), (i as f64 + 1.0, i as f64 + 1.0));
            assert!(
                (atom[4] - (i as f64 - 500.0) * DIAMETER_M - piece.start.u_m[i]).abs() < 1e-14,
                "bead {i}"
            );
            assert_eq!(velocity[1].to_bits(), piece.start.v_m_s[i].to_bits(), "bead {i}");
        }
        let mass_ratio = atoms[500][3] / atoms[0][3];
        assert!((mass_ratio - 0.6).abs() < 1e-15, "{mass_ratio}");
    }
}
