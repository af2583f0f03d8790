# SPDX-License-Identifier: MIT
"""What can go wrong with a study."""

from __future__ import annotations

from omniwheel.errors import OmniError


class StudyError(OmniError):
    """A study cannot go on; its finished batches are kept."""


class StudyInputError(StudyError, ValueError):
    """A study cannot be understood: unknown names, values out of range, a plan without runs."""

    exit_code = 2


class StudyFolderError(StudyError):
    """A study's folder cannot be used: not writable, in use, or it holds something else."""

    exit_code = 2


class ClusterError(StudyError):
    """The cluster cannot be reached, has no workers, or workers that compute other numbers."""
