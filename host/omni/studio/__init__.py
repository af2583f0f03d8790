# SPDX-License-Identifier: MIT
"""The studio: a page in the browser on which a person sees and tunes a robot. docs/guides/studio.md shows it."""
