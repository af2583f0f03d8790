// SPDX-License-Identifier: MIT
/// @file seeded.cpp  A driver without feedback that does the same everywhere: inputs from a seeded generator, and mutations of a
/// few that were kept. usage: PROGRAM SEED BYTES, or PROGRAM FILE... to run stored inputs. An input that takes longer than ten
/// seconds (or FUZZ_HANG_S) ends the process by SIGALRM.
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "check.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

namespace {

unsigned hang_s = 10;
constexpr size_t kept_inputs = 64;
const char *last_path = nullptr;

/// SplitMix64 (Steele, Lea, Flood 2014).
class Generator {
public:
    explicit Generator(uint64_t seed) : state_(seed) {}
    uint64_t next() {
        uint64_t z = state_ += 0x9E3779B97F4A7C15u;
        z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9u;
        z = (z ^ z >> 27) * 0x94D049BB133111EBu;
        return z ^ z >> 31;
    }
    size_t below(size_t count) { return next() % count; }

private:
    uint64_t state_;
};

using Input = std::vector<uint8_t>;

Input fresh(Generator &random) {
    Input input(1 + random.below(random.below(4) == 0 ? 8000 : 800));
    std::generate(input.begin(), input.end(), [&random] { return static_cast<uint8_t>(random.next() >> 56); });
    return input;
}

void mutate(Input *input, Generator &random) {
    static constexpr uint8_t likely[] = {0x00, 0x01, 0x7F, 0x80, 0xFF, 0xFD, 0xFE, 0xC0};
    for (size_t i = 1 + random.below(8); i > 0; --i) {
        uint8_t &byte = (*input)[random.below(input->size())];
        switch (random.below(3)) {
        case 0:
            byte ^= static_cast<uint8_t>(1u << random.below(8));
            break;
        case 1:
            byte = likely[random.below(sizeof likely)];
            break;
        default:
            byte = static_cast<uint8_t>(random.next() >> 56);
        }
    }
}

/// So that a finding can be run again: what is being tried stands in the file named by FUZZ_LAST.
void remember(const Input &input) {
    if (last_path == nullptr) {
        return;
    }
    std::FILE *file = std::fopen(last_path, "wb");
    if (file != nullptr) {
        std::fwrite(input.data(), 1, input.size(), file);
        std::fclose(file);
    }
}

void run(const Input &input) {
    remember(input);
    alarm(hang_s);
    LLVMFuzzerTestOneInput(input.data(), input.size());
    alarm(0);
}

int run_files(int count, char **paths) {
    for (int i = 0; i < count; ++i) {
        std::FILE *file = std::fopen(paths[i], "rb");
        if (file == nullptr) {
            std::fprintf(stderr, "%s: cannot be read\n", paths[i]);
            return 2;
        }
        Input input(1 << 20);
        input.resize(std::fread(input.data(), 1, input.size(), file));
        std::fclose(file);
        run(input);
    }
    return 0;
}

void run_seeded(uint64_t seed, uint64_t bytes) {
    Generator random(seed);
    std::vector<Input> kept;
    while (fuzz::figures().bytes < bytes) {
        Input input = kept.empty() || random.below(2) == 0 ? fresh(random) : kept[random.below(kept.size())];
        mutate(&input, random);
        run(input);
        if (kept.size() < kept_inputs) {
            kept.push_back(input);
        } else if (random.below(16) == 0) {
            kept[random.below(kept.size())] = input;
        }
    }
}

bool number_of(const char *text, uint64_t *number) {
    char *end = nullptr;
    *number = std::strtoull(text, &end, 10);
    return end != text && *end == '\0';
}

} // namespace

int main(int argc, char **argv) {
    last_path = std::getenv("FUZZ_LAST");
    uint64_t seed = 0;
    uint64_t bytes = 0;
    const char *patience = std::getenv("FUZZ_HANG_S");
    if (patience != nullptr && number_of(patience, &bytes)) {
        hang_s = static_cast<unsigned>(bytes);
    }
    if (argc == 3 && number_of(argv[1], &seed) && number_of(argv[2], &bytes)) {
        run_seeded(seed, bytes);
        return 0;
    }
    if (argc > 1) {
        return run_files(argc - 1, argv + 1);
    }
    std::fprintf(stderr, "usage: %s SEED BYTES | FILE...\n", argv[0]);
    return 2;
}
