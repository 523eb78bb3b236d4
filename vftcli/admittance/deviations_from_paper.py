"""What of Section III and IV-C/D is done otherwise here, in plain words, and why."""

DIFFERENCES: tuple[tuple[str, str], ...] = (
    (
        "ξ is stated.",
        "(47) uses a damping ratio ξ that the paper never prints. Here it is B_d/(2√(M_d K_d)), "
        "that of the drag phase (UR5 0.510, rotation 0.671; Panda 2.74, 1.06), unless you set it. "
        "ξ = 1 returns sooner and without overshoot.",
    ),
    (
        "B_dva does not vary.",
        "In 2ξ√(M_dva K_dva) the exponentials and α cancel: B_dva = 2ξ√(M_d K_d) at every speed.",
    ),
    (
        "The speed has a unit.",
        "e^{|Ẋ|} needs a number: here it is e^{|v|/v₀} with v₀ = 1 m/s and 1 rad/s, axis by axis.",
    ),
    (
        "The stability proof is another.",
        "(52)–(55) drop the derivatives of M and K: the printed V rises on the way (0.684 → 1.099 "
        "J in a release from 0.3 m at α = 1.9). W = ½K_d x² + (M_d v₀²/α²) φ(|v|/v₀) with "
        "φ(u) = ¼[1 − (1 + 2u)e^{−2u}] falls, and is what is plotted and checked.",
    ),
    (
        "Rotation has a speed limit.",
        "Tables III and IV print none. φ is bounded, so without a limit the law runs away in "
        "finite time from a release beyond Y*(ξ)·v₀√(M_d/K_d)/α, 18° for the UR5's rotation. Here "
        "it is 1 rad/s.",
    ),
    (
        "“The larger α the better” has an end.",
        "Speed shrinks M and swells K, and the integration (49)–(51) is stable only while "
        "2TsB/M + Ts²K/M < 4 at the speed limit. The number is computed before anything moves.",
    ),
    (
        "Orientation is a rotation vector.",
        "X̃ = X − X_d has no meaning for angles. Here it is log(R R_dᵀ), updated by the exponential "
        "map, which passes through large turns without a jump.",
    ),
    (
        "Thresholds may be soft.",
        "Algorithm 1 lets the whole force in once it passes F_tsd: 20 N for two seconds move the "
        "UR5's parameters by 1.6–2.2 m. “soft” lets in only what exceeds the threshold.",
    ),
    (
        "No break at α = 1.6, no 0.64 s.",
        "Return times go with 1/α throughout. The advance of the peak that Fig. 7 shows is "
        "tabulated here as it comes out of the same force; it is smaller.",
    ),
)
"""(what, why) of each difference."""
