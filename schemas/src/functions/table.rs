//! Coefficients: each the double next to the fraction.

/// `−1/3!, 1/5!, … 1/17!`: `sin p = p + p³·(−1/3! + p²/5! − …)`.
pub(super) const SINE: [f64; 8] = [
    f64::from_bits(0xbfc5_5555_5555_5555),
    f64::from_bits(0x3f81_1111_1111_1111),
    f64::from_bits(0xbf2a_01a0_1a01_a01a),
    f64::from_bits(0x3ec7_1de3_a556_c734),
    f64::from_bits(0xbe5a_e645_67f5_44e4),
    f64::from_bits(0x3de6_1246_13a8_6d09),
    f64::from_bits(0xbd6a_e7f3_e733_b81f),
    f64::from_bits(0x3ce9_52c7_7030_ad4a),
];

/// `1/4!, −1/6!, … −1/18!`: `cos p = 1 − p²/2 + p⁴·(1/4! − p²/6! + …)`.
pub(super) const COSINE: [f64; 8] = [
    f64::from_bits(0x3fa5_5555_5555_5555),
    f64::from_bits(0xbf56_c16c_16c1_6c17),
    f64::from_bits(0x3efa_01a0_1a01_a01a),
    f64::from_bits(0xbe92_7e4f_b778_9f5c),
    f64::from_bits(0x3e21_eed8_eff8_d898),
    f64::from_bits(0xbda9_3974_a8c0_7c9d),
    f64::from_bits(0x3d2a_e7f3_e733_b81f),
    f64::from_bits(0xbca6_8278_63b9_7d97),
];

/// `1/2!, 1/3!, … 1/15!`: `e^r = 1 + r + r²·(1/2! + r/3! + …)`.
pub(super) const EXPONENTIAL: [f64; 14] = [
    f64::from_bits(0x3fe0_0000_0000_0000),
    f64::from_bits(0x3fc5_5555_5555_5555),
    f64::from_bits(0x3fa5_5555_5555_5555),
    f64::from_bits(0x3f81_1111_1111_1111),
    f64::from_bits(0x3f56_c16c_16c1_6c17),
    f64::from_bits(0x3f2a_01a0_1a01_a01a),
    f64::from_bits(0x3efa_01a0_1a01_a01a),
    f64::from_bits(0x3ec7_1de3_a556_c734),
    f64::from_bits(0x3e92_7e4f_b778_9f5c),
    f64::from_bits(0x3e5a_e645_67f5_44e4),
    f64::from_bits(0x3e21_eed8_eff8_d898),
    f64::from_bits(0x3de6_1246_13a8_6d09),
    f64::from_bits(0x3da9_3974_a8c0_7c9d),
    f64::from_bits(0x3d6a_e7f3_e733_b81f),
];

/// `2/3, 2/5, … 2/23`.
pub(super) const LOGARITHM: [f64; 11] = [
    f64::from_bits(0x3fe5_5555_5555_5555),
    f64::from_bits(0x3fd9_9999_9999_999a),
    f64::from_bits(0x3fd2_4924_9249_2492),
    f64::from_bits(0x3fcc_71c7_1c71_c71c),
    f64::from_bits(0x3fc7_45d1_745d_1746),
    f64::from_bits(0x3fc3_b13b_13b1_3b14),
    f64::from_bits(0x3fc1_1111_1111_1111),
    f64::from_bits(0x3fbe_1e1e_1e1e_1e1e),
    f64::from_bits(0x3fba_f286_bca1_af28),
    f64::from_bits(0x3fb8_6186_1861_8618),
    f64::from_bits(0x3fb6_42c8_590b_2164),
];
