//! The skin model on its own, without rendering.

use phasmid::emulator::render::skin::{Layers, Tissue};
use phasmid::profile::Skin;
use std::f64::consts::TAU;

/// Returns the reflectance by finite differences of the equation that Cuccia's formula solves: the
/// diffusion equation in depth, with the exponentially decaying source of incident light and a
/// partial-current boundary.
fn solved(tissue: &Tissue, k: f64) -> f64 {
    let transport = tissue.absorption_per_mm + tissue.reduced_scattering_per_mm;
    let diffusion = 1.0 / (3.0 * transport);
    let n = tissue.refractive_index;
    let inside = 0.0636 * n + 0.668 + 0.710 / n - 1.44 / n.powi(2);
    let leaves = (1.0 - inside) / (2.0 * (1.0 + inside));
    let decay = tissue.absorption_per_mm + diffusion * k * k;
    let slowest = (decay / diffusion).sqrt().min(transport);
    let (cells, depth) = (200_000, 20.0 / slowest);
    let h = depth / f64::from(cells);
    // For each cell i: flux into it through both faces, absorption, source. Thomas's algorithm
    // starts at the bottom, with phi[i] = c phi[i-1] + d.
    let source = |i: i32| {
        let at = |border: i32| (-transport * f64::from(border) * h).exp();
        tissue.reduced_scattering_per_mm / transport * (at(i) - at(i + 1))
    };
    let g = diffusion / h;
    let (mut c, mut d) = (0.0, 0.0);
    for i in (1..cells).rev() {
        let below = if i + 1 < cells { g } else { 0.0 };
        let own = g + below + decay * h - below * c;
        (c, d) = (g / own, (source(i) + below * d) / own);
    }
    // It is half a cell from the centre of the first cell to the boundary, where the flux leaves x
    // phi exits.
    let out = 1.0 / (1.0 / leaves + 1.0 / (2.0 * g));
    let phi = (source(0) + g * d) / (out + g + decay * h - g * c);
    out * phi
}

#[test]
fn the_published_formula_solves_the_diffusion_equation() {
    for (absorption, scattering, index) in [
        (0.02, 2.0, 1.4),
        (0.3, 3.5, 1.33),
        (0.005, 1.5, 1.0),
        (2.0, 1.0, 1.6),
    ] {
        let tissue = Tissue {
            absorption_per_mm: absorption,
            reduced_scattering_per_mm: scattering,
            refractive_index: index,
        };
        for frequency in [0.0, 0.05, 0.172, 0.3, 1.0] {
            let k = TAU * frequency;
            let (formula, solved) = (tissue.reflectance(k), solved(&tissue, k));
            assert!(
                (formula / solved - 1.0).abs() < 1e-4,
                "{tissue:?} {frequency}: {formula} {solved}"
            );
        }
    }
}

#[test]
fn formulas_match_values_computed_by_hand() {
    // Computed by hand from the papers: n = 1.4 gives Reff = 0.5295 and A = 0.1538.
    let tissue = Tissue {
        absorption_per_mm: 0.02,
        reduced_scattering_per_mm: 2.0,
        refractive_index: 1.4,
    };
    assert!((tissue.reflectance(0.0) - 0.6149).abs() < 1e-4);
    assert!((tissue.transfer(TAU * 0.1) - 0.6708).abs() < 1e-4);
    // For an incidence of 45 degrees: 0.5051 / 2.007.
    assert!((tissue.shift_mm(0.5f64.sqrt()) - 0.2517).abs() < 1e-4);
    assert_eq!((tissue.transfer(0.0), tissue.shift_mm(0.0)), (1.0, 0.0));
}

#[test]
fn darker_classes_reflect_less_and_spread_light_alike() {
    for (nm, palest, darkest) in [
        (450.0, 0.20..0.50, 0.005..0.10),
        (550.0, 0.25..0.55, 0.03..0.20),
        (650.0, 0.45..0.75, 0.08..0.30),
        (850.0, 0.50..0.80, 0.25..0.60),
    ] {
        let class = |fitzpatrick| {
            let skin = Skin {
                fitzpatrick: Some(fitzpatrick),
                absorption_per_mm: None,
                reduced_scattering_per_mm: None,
                refractive_index: 1.4,
            };
            Layers::new(&skin, nm)
        };
        let all: Vec<_> = (1..=6).map(class).collect();
        println!("{nm} nm: {:?}", all[0].tissue);
        for pair in all.windows(2) {
            println!("{:.3} {:.3}", pair[0].reflectance(), pair[1].reflectance());
            assert!(pair[0].reflectance() > pair[1].reflectance());
            assert_eq!(pair[0].tissue, pair[1].tissue);
        }
        // Measured reflectance of the lightest and the darkest human skin.
        assert!(palest.contains(&all[0].reflectance()) && darkest.contains(&all[5].reflectance()));
    }
}
