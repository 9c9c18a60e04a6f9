# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Which law to believe
#
# A library holds many laws, and several fit. This notebook follows the choice: the best law of
# every size, the laws that the data cannot rule out, what noise
# does to all that, and what no evidence can decide.
#
# The data are σ12 in four oscillatory flows of a linear Phan-Thien–Tanner fluid, ε = 0.2, whose
# term is tr(σ)σ, with 5 % noise. Eleven terms may be chosen.

# %%
import matplotlib.pyplot as plt
import pandas as pd

import discover as dc

flows = {f"laos_{wi:g}_{de:g}": dc.oscillatory_shear(wi, de) for wi in (1, 2) for de in (0.5, 1)}


def measure(noise):
    return dc.synthetic_dataset(
        "ptt_linear", {"epsilon": 0.2}, protocol=flows, noise=noise, n_samples=65, duration=8.0
    )


extra = ("tr(sigma)*sigma", "tr(sigma)*gammadot", "tr(sigma.gammadot)*I")
library = dc.build_library(extra=extra)
library.names

# %% [markdown]
# ## The path: the best law of every size
#
# Misfit on the data that were fitted can only fall as terms are added. On runs that a refit did not
# see (`held_out`) it need not, and the evidence charges for every term and for having looked at many
# laws. Where the misfit stops at the noise, more terms only describe the noise.

# %%
data = measure(0.05)
model = dc.TensorSINDy(library, max_terms=3).fit(data)
model.result_.path_table()

# %%
path = model.result_.path_table()
figure, axes = plt.subplots(1, 2, figsize=(9, 3), layout="constrained")
axes[0].semilogy(path["size"], path["misfit"], "o-", label="all runs")
axes[0].semilogy(path["size"], path["held_out"], "s--", label="runs left out")
axes[0].axhline(0.05, color="0.6", lw=1, label="noise")
axes[0].set(xlabel="number of terms", ylabel="relative misfit", xticks=path["size"])
axes[0].legend()
likely = model.result_.inclusion_table().iloc[:6][::-1]
axes[1].barh(likely["term"], likely["probability"], height=0.5)
axes[1].set(xlabel="probability of the term", xlim=(0, 1))
plt.show()

# %% [markdown]
# ## The law
#
# The notebook displays the law. `.table()` gives it as a DataFrame, `.sympy()` for further algebra
# and `.latex()` for a paper.

# %%
model.result_

# %%
model.result_.sympy()

# %%
print(model.result_.latex())

# %% [markdown]
# ## Rivals
#
# The chosen law is not the only one that fits. Every law that the search fitted is weighed against
# the chosen one: listed is what the data make less than 150 times as improbable.

# %%
model.result_.rivals_table()

# %% [markdown]
# ## What noise does
#
# The same flows at other noise. First the interval widens, then rivals appear that the data do not
# rule out, and in the end a law other than the true one fits best, with the true one among its
# rivals. From there on the data give no single law, only a list.

# %%
lines = []
for noise in (0.01, 0.05, 0.2, 0.5):
    noisy = model if noise == 0.05 else dc.TensorSINDy(library, max_terms=3).fit(measure(noise))
    found = noisy.result_.table()
    laws = [rival["support"] for rival in noisy.result_.details["rivals"]]
    lines.append(
        {
            "noise": f"{noise:.0%}",
            "law": " + ".join(found["term"]),
            "coefficients": ", ".join(f"{value:.3f}" for value in found["coefficient"]),
            "95 % half-widths": ", ".join(f"{h:.3f}" for h in (found["high"] - found["low"]) / 2),
            "rivals": len(laws),
            "the true law": "chosen"
            if list(found["term"]) == ["tr(sigma)*sigma"]
            else ("a rival" if {"tr(sigma)*sigma"} in map(set, laws) else "ruled out"),
        }
    )
pd.DataFrame(lines)

# %% [markdown]
# ## Not determined by these data
#
# No evidence and no amount of data helps where two laws give the same σ12 in these flows. This can be
# known before anything is measured: which combinations of terms no measurement sees, and whether
# they change the normal stresses.

# %%
dc.identify.analyse_structure(data, library, model.terms_)

# %% [markdown]
# Among laws that differ in σ12 the choice depends on the noise; the evidence settles it
# or says that it cannot. The choice along an unseen combination is a matter of what was measured:
# more σ12 will never settle it; one run with N2 may. The notebook `identifiability` goes on from
# here.
