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
    config.chain.alpha = alpha;
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
    for (method, alpha, golden) in GOLDEN {
        let found = hash_of_run(&physics(method, alpha));
        assert_eq!(found, golden, "{method}, α = {alpha}: {found:#018x}");
    }
}

const GOLDEN: [(Method, f64, u64); 24] = [
    (Method::VelocityVerlet, 1.0, 0xe92e_0923_ae4c_bfe5),
    (Method::VelocityVerlet, 1.01, 0xcdae_ac46_c206_442d),
    (Method::VelocityVerlet, 1.3, 0xc755_0683_2dcd_7fd0),
    (Method::VelocityVerlet, 1.5, 0x3190_e281_7279_d297),
    (Method::VelocityVerlet, 2.0, 0xedf9_76f8_47a5_9112),
    (Method::VelocityVerlet, 2.5, 0xc889_895c_8d06_6156),
    (Method::VelocityVerlet, 3.0, 0x774b_870d_05dc_d6ba),
    (Method::VelocityVerlet, 10.0, 0x1de9_ca21_bd13_267a),
    (Method::Rkn4, 1.0, 0xbf7a_8bb4_1ee5_ec1d),
    (Method::Rkn4, 1.01, 0x0226_0b37_7832_d105),
    (Method::Rkn4, 1.3, 0x8a8a_4f77_395c_30b3),
    (Method::Rkn4, 1.5, 0x0b4d_8424_aa0c_3af4),
    (Method::Rkn4, 2.0, 0xe423_d4a4_e905_271e),
    (Method::Rkn4, 2.5, 0xac90_d2d9_93b0_fd3b),
    (Method::Rkn4, 3.0, 0xbe3d_8ac2_417e_de54),
    (Method::Rkn4, 10.0, 0x4903_95e2_6095_531f),
    (Method::Gear5, 1.0, 0xce79_bdce_bfee_a8dd),
    (Method::Gear5, 1.01, 0x0f75_f133_cfb0_629c),
    (Method::Gear5, 1.3, 0x6ea2_3d2f_4e30_4a13),
    (Method::Gear5, 1.5, 0x3762_d5f6_3b9b_5822),
    (Method::Gear5, 2.0, 0xe9bb_4406_5f11_14fb),
    (Method::Gear5, 2.5, 0x1b5e_0039_ca20_6a4d),
    (Method::Gear5, 3.0, 0x833a_1754_dc28_3377),
    (Method::Gear5, 10.0, 0x7d35_da55_8ac3_6cd6),
];
