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
# # Full-stress data with pysindy
#
# A simulation, or a rheometer that measures N1 and N2 too, gives every component of the stress.
# Then there is no unmeasured stress to integrate: the law is a regression of dσ/dt on σ and γ̇,
# which pysindy solves by itself. The tensor library adds what a general polynomial lacks: frame
# invariance.
#
# The data: a Giesekus fluid, α = 0.3, in two oscillations and a start-up, made by scipy, with 0.5 %
# noise. Stress is in units of the modulus, time in units of the relaxation time.

# %%
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pysindy as ps
from scipy.integrate import solve_ivp
from scipy.optimize import lsq_linear

import discover as dc

ALPHA = 0.3
times = np.linspace(0.0, 12.0, 1201)
rates = [lambda t: 2.0 * np.cos(t), lambda t: 4.0 * np.cos(2.0 * t), lambda t: 3.0 + 0.0 * t]


def giesekus(rate):
    def derivative(t, s):
        s11, s22, s12 = s  # σ33 stays zero in this law
        g = rate(t)
        return (
            2 * g * s12 - s11 - ALPHA * (s11**2 + s12**2),
            -s22 - ALPHA * (s22**2 + s12**2),
            g * (1 + s22) - s12 - ALPHA * s12 * (s11 + s22),
        )

    return solve_ivp(
        derivative, (0, times[-1]), np.zeros(3), t_eval=times, rtol=1e-9, atol=1e-11
    ).y.T


random = np.random.default_rng(0)
clean = [giesekus(rate) for rate in rates]
stresses = [s + 0.005 * np.sqrt(np.mean(s**2)) * random.standard_normal(s.shape) for s in clean]
controls = [rate(times)[:, None] for rate in rates]

# %% [markdown]
# ## A polynomial in components
#
# The textbook way: every product of two of (σ11, σ22, σ12, γ̇), in each of the three equations.

# %%
names = ["s11", "s22", "s12", "g"]
settings = {
    "feature_library": ps.PolynomialLibrary(degree=2, include_bias=False),
    "differentiation_method": ps.SmoothedFiniteDifference(
        smoother_kws={"window_length": 25, "polyorder": 4}
    ),
}
free = ps.SINDy(optimizer=ps.STLSQ(threshold=0.05), **settings)
free.fit(stresses, t=times, u=controls, feature_names=names)
free.print(precision=2)

# %% [markdown]
# These are three independent equations. In a Giesekus law the same α appears in all of them; here
# the coefficients of σ12² in the first two equations, and of σ11 σ12 and σ22 σ12 in the last, are
# four different numbers. A law in which they differ depends on the choice of axes.

# %%
places = {"11: σ12²": (0, "s12^2"), "22: σ12²": (1, "s12^2")}
places |= {"12: σ11 σ12": (2, "s11 s12"), "12: σ22 σ12": (2, "s22 s12")}


def mobilities(found):
    """Return what stands for −α at each of its four places."""
    known = free.get_feature_names()
    return {place: found[row, known.index(name)] for place, (row, name) in places.items()}


pd.Series(mobilities(free.coefficients()), name="should all be −0.3").round(3).to_frame()

# %% [markdown]
# ## Frame invariance as constraints
#
# The upper-convected production and the tensors of the library span all polynomials of this degree
# that do not depend on the observer (and do not vanish in shear). So the coefficients of all three
# equations together are a combination of five known matrices, one number each; and the number of
# σ·σ cannot be positive, as a mobility is not negative: bounded least squares. (pysindy's
# `ConstrainedSR3` takes the same as constraints, and needs `pip install "discover-rheology[cvxpy]"`.)

# %%
import jax
import jax.numpy as jnp

jax.config.update("jax_enable_x64", True)

from tensor_library import rate_of_deformation, upper_convected_production

KEPT = ["sigma", "gammadot", "sigma.sigma", "sigma.gammadot+gammadot.sigma"]
library = dc.build_library(KEPT, degree=0)


def tensors(state):
    """Return the production and the tensors of the library, 11, 22 and 12 of each."""
    s11, s22, s12, rate = state
    stress = jnp.stack([s11, s22, jnp.zeros_like(s11), s12])
    terms = library.evaluate(stress, rate_of_deformation(rate), jnp.asarray(library.inner_default))
    production = upper_convected_production(stress, rate)
    return jnp.concatenate([production[None], terms])[:, jnp.array([0, 1, 3])]


anywhere = random.standard_normal((200, 4))
products = np.asarray(ps.PolynomialLibrary(degree=2, include_bias=False).fit_transform(anywhere))
values = np.asarray(jax.vmap(tensors)(jnp.asarray(anywhere)))  # sample, tensor, component
spanned = np.stack(
    [np.linalg.lstsq(products, values[:, k], rcond=None)[0].T for k in range(len(KEPT) + 1)]
)  # coefficients by tensor, component and feature
differentiate = settings["differentiation_method"]
slopes = np.vstack([differentiate(s, times) for s in stresses])
states = np.hstack([np.vstack(stresses), np.vstack(controls)])
features = np.asarray(ps.PolynomialLibrary(degree=2, include_bias=False).fit_transform(states))
columns = np.einsum("nf,tkf->nkt", features, spanned)
limits = np.full(len(KEPT) + 1, np.inf)
limits[1 + KEPT.index("sigma.sigma")] = 0.0
numbers = lsq_linear(columns.reshape(-1, len(limits)), slopes.ravel(), (-np.inf, limits)).x
tied = np.tensordot(numbers, spanned, 1)
pd.Series(numbers, index=["production", *KEPT], name="coefficient").round(3).to_frame()

# %%
both = pd.DataFrame({"free": mobilities(free.coefficients()), "constrained": mobilities(tied)})
axes = both.plot.bar(rot=0, figsize=(7, 3), ylabel="coefficient")
axes.axhline(-ALPHA, color="black", linestyle=":")
plt.show()

# %% [markdown]
# ## The same without constraints
#
# A shorter way, which `discover` also uses, is to regress on the tensors themselves, with all
# components in one column. A coefficient is then one number for all equations, and any pysindy
# optimiser will do.

# %%
columns = np.asarray(jax.vmap(tensors)(jnp.asarray(states)))
target = (slopes - columns[:, 0]).ravel()
design = columns[:, 1:].transpose(0, 2, 1).reshape(target.size, -1)
stacked = ps.STLSQ(threshold=0.05).fit(design, target[:, None])
pd.Series(stacked.coef_[0], index=KEPT, name="coefficient").round(3).to_frame()

# %% [markdown]
# Truth: dσ/dt = L·σ + σ·Lᵀ + γ̇ − σ − 0.3 σ·σ. With σ12 alone none of this is possible: the other
# components have to be integrated along each trial law, which is what `TensorSINDy` is for.
