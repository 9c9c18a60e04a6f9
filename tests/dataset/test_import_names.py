"""Claims: names of quantities are known in many languages and spellings."""

import csv
from pathlib import Path

import numpy as np
import pytest
from made_exports import columns

from discover.dataset.importing import import_files
from discover.dataset.importing.mapping import Mapping, make_mapping
from discover.dataset.importing.names import plain, rank_of, shipped_names, tables_of
from discover.dataset.importing.quantities import QUANTITIES
from discover.errors import InputError

RATE = [0.5, 2.0, 8.0, 32.0]
STRESS = [3.0, 6.0, 12.0, 24.0]
OMEGA = [0.5, 1.0, 2.0, 4.0]
STORAGE = [10.0, 30.0, 80.0, 200.0]
LOSS = [40.0, 70.0, 110.0, 150.0]

with Path(__file__).with_name("names_by_language.csv").open(encoding="utf-8", newline="") as _file:
    LANGUAGES = {row["language"]: row for row in csv.DictReader(_file)}
CODE_PAGES = [language for language, row in LANGUAGES.items() if row["code page"]]


def lines(names, units, *columns):
    head = ";".join(f"{name} [{unit}]" for name, unit in zip(names, units, strict=True))
    return "\n".join([head, *(";".join(map(str, row)) for row in zip(*columns, strict=True))])


def read(folder, text, encoding="utf-8", name="a.txt", **known):
    file = folder / name
    file.write_bytes(text.encode(encoding))
    return import_files([file], Mapping(**known))


@pytest.mark.parametrize("language", LANGUAGES)
def test_flow_curves_and_sweeps_are_read_in_each_language(tmp_path, language):
    _, _, rate, stress, viscosity, omega, storage, loss = LANGUAGES[language].values()
    thick = [s / r for s, r in zip(STRESS, RATE, strict=True)]
    curve = lines((rate, stress), ("1/s", "Pa"), RATE, STRESS)
    from_viscosity = lines((rate, viscosity), ("1/s", "Pa·s"), RATE, thick)
    for text in (curve, from_viscosity):
        table = columns(read(tmp_path, text).files["flow_curve.csv"])
        np.testing.assert_allclose(table["shear_rate_1_s"], RATE)
        np.testing.assert_allclose(table["stress_Pa"], STRESS)
    sweep = lines((omega, storage, loss), ("rad/s", "Pa", "kPa"), OMEGA, STORAGE, LOSS)
    table = columns(read(tmp_path, sweep).files["lve.csv"])
    np.testing.assert_allclose(table["Gp_Pa"], STORAGE)
    np.testing.assert_allclose(table["Gpp_Pa"], np.multiply(LOSS, 1e3))


@pytest.mark.parametrize("language", CODE_PAGES)
def test_the_code_page_of_the_country_is_found_from_the_names(tmp_path, language):
    _, code_page, rate, stress, *_ = LANGUAGES[language].values()
    text = lines((rate, stress), ("1/s", "Pa"), RATE, STRESS)
    made = read(tmp_path, text, code_page)
    np.testing.assert_allclose(columns(made.files["flow_curve.csv"])["stress_Pa"], STRESS)


@pytest.mark.parametrize(
    ("key", "spellings"),
    [
        ("shear_rate", "ɣ̇§γ̇§γ ̇§γ˙§ẏ§γ_dot§gamma_dot§GammaDot§gammadot§gdot§$\\dot{\\gamma}$§dγ/dt§"
                       "ShearRate§StrainRate§S. Rate§SHEAR_RATE§Ｓｈｅａｒ　Ｒａｔｅ"),
        ("strain", "ɣ§γ§Gamma§Shear Strain§ShearStrain§Déformation de Cisaillement"),
        ("step_time", "Intervalle Temps"), ("temperature", "Température"),
        ("stress", "τ§Tau§sigma_xy§σ₁₂§ShearStress§Shear stress τ§S. Stress"),
        ("Gp", "G'§G′§G’§G´§Storage mod.§StorageModulus§Storage modulus (G')§GPrime"),
        ("Gpp", "G''§G″§G\"§G′′§G’’§Loss mod.§LossModulus§Loss modulus G″"),
        ("complex_modulus", "|G*|§G*§|G∗|§Complex modulus |G*|"),
        ("complex_viscosity", "η*§eta*§Compl. visc."),
        ("loss_factor", "tan δ§tan(δ)§tan(delta)§TanDelta§tan_delta"),
        ("omega", "ω§Omega§AngFreq§Ang. freq.§Angular frequency ω"),
        ("psi1", "Ψ1§Ψ₁§psi_1§First normal stress coefficient"),
        ("N1", "N1§N₁§N_1§First normal stress difference"),
        ("extensional_viscosity", "Extensional viscosity§Elongational viscosity§η_E§ηE+"),
        ("hencky_rate", "ε̇§ɛ̇§epsilon_dot§Hencky rate§HenckyRate"),
    ],
)  # fmt: skip
def test_a_name_is_known_however_it_is_spelled(key, spellings):
    unknown = [one for one in spellings.split("§") if rank_of(key, one) is None]
    assert not unknown


@pytest.mark.parametrize(
    "name",
    ["Status", "Comment", "Step no", "G'/G''", "Shear str.", "Raw phase", "Set point", "RPM"],
)
def test_a_name_that_says_something_else_or_too_little_is_none(name):
    assert not tables_of(name)


def test_a_name_means_one_quantity_and_every_quantity_has_names_and_can_be_named_by_the_user():
    places: dict[str, set[str]] = {}
    for section, names in shipped_names().items():
        for name in names:
            places.setdefault(plain(name), set()).add(section)
    several = {name for name, sections in places.items() if len(sections) > 1}
    assert several == {"t", "gp", "ω", "φ", "θ"}
    named = make_mapping({"columns": dict.fromkeys(QUANTITIES, "x")}, "the options").columns
    assert set(named) == set(QUANTITIES) <= set(shipped_names())
    for name in ("Interval", "Segment", "Step"):
        assert "step_time" not in tables_of(name)
    for name in ("Intervallzeit", "Interval time", "Segment time"):
        assert "step_time" in tables_of(name)


@pytest.mark.parametrize(("known", "modulus"), [("Storage modulus", STORAGE), ("G''", LOSS)])
def test_one_modulus_and_the_tangent_of_the_loss_angle_give_the_other(tmp_path, known, modulus):
    tangent = np.divide(LOSS, STORAGE)
    names, units = ("ω", known, "tan(delta)"), ("rad/s", "Pa", "-")
    table = columns(read(tmp_path, lines(names, units, OMEGA, modulus, tangent)).files["lve.csv"])
    np.testing.assert_allclose(table["Gp_Pa"], STORAGE)
    np.testing.assert_allclose(table["Gpp_Pa"], LOSS)


def test_viscosities_and_normal_stress_coefficients_become_stresses_by_their_rates(tmp_path):
    time, thick = [0.1, 0.2, 0.4, 0.8, 1.6], [100.0, 180.0, 300.0, 450.0, 700.0]
    for name in ("Extensional viscosity", "Viscosity"):
        text = lines(("Time", "Hencky rate", name), ("s", "1/s", "kPa·s"), time, [0.5] * 5, thick)
        table = columns(read(tmp_path, text).files["a.csv"])
        np.testing.assert_allclose(table["tensile_stress_Pa"], np.multiply(thick, 500.0))
    psi = [4.0, 3.0, 2.0, 1.0]
    names, units = ("Shear rate", "Shear stress", "Ψ1"), ("1/s", "Pa", "Pa·s²")
    table = columns(read(tmp_path, lines(names, units, RATE, STRESS, psi)).files["flow_curve.csv"])
    np.testing.assert_allclose(table["N1_Pa"], np.multiply(psi, np.square(RATE)))


def test_a_size_without_its_phase_is_no_sweep_and_beside_the_moduli_no_news(tmp_path):
    size = np.hypot(STORAGE, LOSS) / OMEGA
    names, units = ("ω", "|η*|"), ("rad/s", "Pa s")
    with pytest.raises(InputError, match=r"\|η\*\| alone does not give G' and G''"):
        read(tmp_path, lines(names, units, OMEGA, size))
    whole = lines((*names, "G'", "G''"), (*units, "Pa", "Pa"), OMEGA, size, STORAGE, LOSS)
    assert not any("not read" in line for line in read(tmp_path, whole).said)
