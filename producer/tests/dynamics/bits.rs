//! The bits of whole runs. They change only together with `KERNEL_VERSION`.

use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::manifest::Physics;
use schemas::method::Method;
use schemas::presets::PRESETS;

/// FNV-1a over the bits of every state of a run.
fn hash_of_run(physics: &Physics) -> u64 {
    let mut integrator = Integrator::new(physics);
    let mut state = ChainState::initial(physics);
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for _ in 0..physics.step_count {
        integrator.step(&mut state);
        for x in state.u_m.iter().chain(state.v_m_s.iter()).chain(state.extra.iter()) {
            hash = (hash ^ x.to_bits()).wrapping_mul(0x0100_0000_01b3);
        }
    }
    hash
}

/// 60 beads with a light and a heavy impurity, 600 steps of 0.02 T.
fn physics(method: Method, alpha: f64) -> Physics {
    let mut config = PRESETS[0].config();
    config.chain.beads = 60;
    config.chain.alpha = Some(alpha);
    config.chain.impurities[0].bead = 20;
    let heavy = schemas::config::Impurity { bead: 40, mass_kg: 3e-3 };
    config.chain.impurities.push(heavy);
    config.integrator.method = method;
    config.time.duration_s = 1e6;
    let mut physics = Physics::resolve(&config).expect("valid");
    physics.dt_s = 0.02 * physics.scales().time_s;
    physics.step_count = 600;
    physics
}

#[test]
fn whole_runs_have_the_bits_they_always_had() {
    let found = GOLDEN.map(|(method, alpha, _)| (method, alpha, hash_of_run(&physics(method, alpha))));
    assert!(found == GOLDEN, "other bits: {found:#018x?}");
}

const GOLDEN: [(Method, f64, u64); 24] = [
    (Method::VelocityVerlet, 1.0, 0x262d_43b3_8417_6b7b),
    (Method::VelocityVerlet, 1.01, 0xe335_4f87_2af4_c706),
    (Method::VelocityVerlet, 1.3, 0xb957_cd3d_d2ae_5183),
    (Method::VelocityVerlet, 1.5, 0xbed2_08a7_fd39_2b98),
    (Method::VelocityVerlet, 2.0, 0x8ef3_83eb_1049_1c52),
    (Method::VelocityVerlet, 2.5, 0xe413_957c_4f3a_3080),
    (Method::VelocityVerlet, 3.0, 0x7332_2121_0a67_37eb),
    (Method::VelocityVerlet, 10.0, 0x6d6f_1864_1e89_5d81),
    (Method::Rkn4, 1.0, 0x889a_f305_6873_7208),
    (Method::Rkn4, 1.01, 0xdad4_989a_14f0_efb7),
    (Method::Rkn4, 1.3, 0xc154_729e_30e0_90f5),
    (Method::Rkn4, 1.5, 0xa947_2cca_358f_2acd),
    (Method::Rkn4, 2.0, 0x62a0_05e7_516f_c2c3),
    (Method::Rkn4, 2.5, 0xc728_67d2_74cb_88c6),
    (Method::Rkn4, 3.0, 0x29f2_3c68_a78b_214c),
    (Method::Rkn4, 10.0, 0xa9f2_f9e1_0e4f_a42a),
    (Method::Gear5, 1.0, 0xd54f_8402_557a_bff5),
    (Method::Gear5, 1.01, 0xc1a6_c140_04d6_53cd),
    (Method::Gear5, 1.3, 0x6200_3428_84e8_8ced),
    (Method::Gear5, 1.5, 0x3259_503b_0c32_2e92),
    (Method::Gear5, 2.0, 0xc135_686d_ec0c_643b),
    (Method::Gear5, 2.5, 0x9d6b_4296_4c76_c96d),
    (Method::Gear5, 3.0, 0x926e_89f4_9d6f_cc92),
    (Method::Gear5, 10.0, 0x5ebe_8862_dc9c_7d8c),
];
