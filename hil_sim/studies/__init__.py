# SPDX-License-Identifier: MIT
"""Studies: very many runs of a scenario, over seeds, parameters or both, on all processors or a Dask cluster.

A study is a plan of batches (:mod:`plan`), done by a pool (:mod:`pools`, :mod:`cluster`). They are kept in a folder
(:mod:`folder`, :mod:`store`) and folded in the plan's order (:mod:`study_summary`). Who computed a batch, when, and in
which session shows nowhere in the numbers.
"""
