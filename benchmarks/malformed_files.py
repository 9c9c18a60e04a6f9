"""Sane files of every sort that the command line reads, to be harmed."""

from pathlib import Path

RUN = "time_s,shear_rate_1_s,stress_Pa,N1_Pa\n" + "".join(
    f"{0.1 * i:.1f},0.5,{2 * (1 - 0.9**i):.6f},{0.1 * i:.2f}\n" for i in range(14)
)
STRAIN_RUN = "time_ms,strain,stress_kPa\n" + "".join(
    f"{i},{0.1 * i:.6f},{1 - 0.9**i:.6f}\n" for i in range(24)
)
FOLDER = {
    "runs.csv": "file,factor,label\na.csv,2.0,first\nb.csv,4.0,second\n",
    "a.csv": RUN,
    "b.csv": STRAIN_RUN,
    "lve.csv": "omega_rad_s,Gp_Pa,Gpp_Pa\n10,50,5\n1,25,25\n0.1,1,5\n",
}
STUDY = {
    "data": {
        "folder": ".",
        "fit": ["a.csv"],
        "held_out": ["b.csv"],
        "clock_factor": "factor",
        "rate": "commanded",
        "rate_before": "factor",
        "sequence": "factor",
    },
    "model": {
        "law": "giesekus",
        "modulus_Pa": "fit",
        "relaxation_time_s": 1.0,
        "parameters": {"alpha": 0.3},
        "known_relaxation": True,
    },
    "loop": {
        "max_effects": 3,
        "strain": [0.02, 25.0],
        "noise": 0.01,
        "effects": ["giesekus_mobility", "stress_offset"],
    },
}
COMPARISON = {
    "data": {
        "synthetic": {
            "law": "giesekus",
            "parameters": {"alpha": 0.2},
            "protocol": "paper",
            "noise": 0.01,
            "seed": 0,
            "samples": 11,
        },
        "held_out": ["laos_1_1"],
    },
    "model": {"law": "ucm", "modulus_Pa": 1.0, "relaxation_time_s": 1.0},
    "compare": {
        "learners": ["tensor_sindy", "tbnn_ude"],
        "library": {"degree": 1, "closed_forms": ["exp"]},
        "test": "paper",
        "seed": 0,
        "max_terms": 3,
        "high_deborah": [1.5],
        "distillation": False,
        "sweep": {"laws": ["ptt_linear"], "parameter": "epsilon", "values": [0.1]},
        "next": {"flows": ["laos"], "observe": ["N1"], "noise": 0.01},
    },
}
LAW = {
    "format": "discover law 1",
    "title": "found",
    "notes": ["a note"],
    "terms": [
        {"term": "sigma.sigma", "coefficient": 0.2, "inner": {}, "ci95": [0.1, 0.3]},
        {
            "term": "(exp(epsilon*tr(sigma))-1)*sigma",
            "coefficient": 0.1,
            "inner": {"epsilon": 0.4},
            "ci95": None,
        },
        {"term": "tr(sigma.gammadot)*I", "coefficient": 0.1, "inner": {}, "ci95": None},
    ],
    "linear_relaxation": True,
    "modes": [{"modulus_Pa": 10.0, "relaxation_time_s": 0.5}],
    "solvent_viscosity_Pa_s": 0.1,
    "tested": {
        "learned_in": {"Wi": [1.0, 2.0], "De": [0.25, 1.0]},
        "judged_in": {"Wi": [2.0, 3.0], "De": [0.1, 1.5]},
        "worst_errors": {"sigma12": 0.01},
    },
}
TERM = {"term": "sigma.sigma", "coefficient": 0.2, "ci95": [0.1, 0.3], "inner": {}}
RESULTS = {
    "comparison.json": {
        "learners": {
            "tensor_sindy": {
                "terms": [TERM],
                "errors": {"laos_1_1": {"sigma12": 0.01, "N1": 0.02, "N2": None}},
                "train_seconds": 1.0,
                "details": {"selectors": {"chosen": {"bic": ["sigma.sigma"]}}},
                "law": LAW,
            }
        },
        "rivals": [],
        "undetermined": ["N2"],
    },
    "loop.json": {
        "verdict": "effects_added",
        "error_before": {"fit": 0.4, "held_out": None},
        "error_after": {"fit": 0.01, "held_out": 0.02},
        "stages": [{"effect": "giesekus_mobility", "kind": "constitutive"}],
        "law": LAW,
    },
}
EXPORTS = {
    "trios.txt": "Filename\tmelt\n\n[step]\nPeak hold - 1\nStep time\tShear rate\tStress\tStatus\n"
    "s\t1/s\tkPa\t\n" + "".join(f"{0.1 * i:.1f}\t0.5\t{0.1 * i:.2f}\tok\n" for i in range(14)),
    "rheocompass.csv": "Project:\tmelt\nInterval and data points:\t1\t14\nInterval data:\tPoint No."
    "\tTime\tShear Rate\tShear Stress\tTorque\n\n\t\t[s]\t[1/s]\t[Pa]\t[mN·m]\n"
    + "".join(f"\t{i + 1}\t{0.1 * i:.1f}\t0.5\t{0.1 * i:.2f}\t{i}\n" for i in range(14)),
    "plain.csv": "time [s];shear rate [1/s];stress [Pa]\n"
    + "".join(f"{i},5;0,5;{i},25\n" for i in range(14)),
}
SWEEP = "Angular frequency\tStorage modulus\tLoss modulus\nrad/s\tPa\tkPa\n" + "".join(
    f"{10.0**i}\t{100.0 ** (i + 1)}\t{10.0**i}\n" for i in range(4)
)
MAPPING = {
    "start_time_s": 0.0,
    "blocks": [1],
    "columns": {"time": "Step time", "stress": "Stress"},
    "units": {"stress": "kPa"},
    "layout": {"delimiter": "tab", "decimal": "."},
    "geometry": {"type": "cone_plate", "radius_mm": 25.0, "angle_deg": 1.0},
    "source": [{"file": "trios.txt", "sweep": False}],
}
OVERLAY = "run,time_s,quantity,value\n" + "".join(f"a.csv,{k / 10},sigma12,{k}\n" for k in range(9))
ESTIMATOR = {
    "format": "discover estimator", "version": 1, "learner": "tensor_sindy",
    "parameters": {"base": {"kind": "fluid", "fields": {
        "law": {"kind": "named_law", "name": "ucm", "values": {}, "linear_relaxation": True},
        "modulus": {"kind": "array", "name": "array0"}, "relaxation_time": 1.0}}},
    "fitted": {"fluid_": {"kind": "network", "width": 10**9, "depth": 3, "fields": {},
                          "weights": {"kind": "list", "items": []}}},
}  # fmt: skip


def write_files(root: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        (root / name).write_text(text, encoding="utf-8", errors="surrogatepass")
