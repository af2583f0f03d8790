// SPDX-License-Identifier: MIT
#pragma once

struct FakeCrashReport {
    void clear();
};
extern FakeCrashReport CrashReport;
