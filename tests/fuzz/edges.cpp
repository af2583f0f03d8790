// SPDX-License-Identifier: MIT
/// @file edges.cpp  Which edges of the program a seeded run took: Clang's counters (-fsanitize=fuzzer-no-link), without
/// libFuzzer. With FUZZ_EDGES=FILE a line per edge is written at exit: address in the program's file, then 1 if it was
/// taken.
#include <cstdint>
#include <cstdio>
#include <cstdlib>

extern "C" {
extern const char __executable_start;
void __sanitizer_cov_8bit_counters_init(const uint8_t *begin, const uint8_t *end);
void __sanitizer_cov_pcs_init(const uintptr_t *begin, const uintptr_t *end);
}

namespace {

const uint8_t *counters = nullptr;
const uintptr_t *places = nullptr; ///< two words for each counter: address, flags
size_t count = 0;

void write_edges() {
    const char *path = std::getenv("FUZZ_EDGES");
    std::FILE *file = path != nullptr ? std::fopen(path, "w") : nullptr;
    for (size_t i = 0; file != nullptr && i < count; ++i) {
        const uintptr_t address = places[2 * i] - reinterpret_cast<uintptr_t>(&__executable_start);
        std::fprintf(file, "0x%zx %d\n", static_cast<size_t>(address), counters[i] != 0 ? 1 : 0);
    }
    if (file != nullptr) {
        std::fclose(file);
    }
}

} // namespace

void __sanitizer_cov_8bit_counters_init(const uint8_t *begin, const uint8_t *end) {
    if (counters == nullptr && begin != end) {
        counters = begin;
        count = static_cast<size_t>(end - begin);
        std::atexit(write_edges);
    }
}

void __sanitizer_cov_pcs_init(const uintptr_t *begin, const uintptr_t *) {
    places = begin;
}
