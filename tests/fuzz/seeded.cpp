// SPDX-License-Identifier: MIT
/// @file seeded.cpp  A driver without feedback that does the same everywhere: inputs from a seeded generator, and
/// mutations of a few that were kept.
///
/// Usage: PROGRAM SEED BYTES, until the code under test was handed so many bytes. PROGRAM SEED BLOCK COUNT LONGEST:
/// COUNT inputs of at most LONGEST bytes, the BLOCK-th such lot of this seed. A lot depends on nothing before it.
/// PROGRAM FILE... runs stored inputs. An input that takes longer than ten seconds (or FUZZ_HANG_S) ends the process by
/// SIGALRM. What ends the process is left in the file named by FUZZ_LAST.
#include <fcntl.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "check.h"
#include "generator.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
/// A target that changes its inputs itself has this.
extern "C" __attribute__((weak)) size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t capacity,
                                                                unsigned seed);
extern "C" __attribute__((weak)) void __sanitizer_set_death_callback(void (*callback)());

namespace {

using Input = std::vector<uint8_t>;

constexpr size_t kept_inputs = 64;
const char *last_path = nullptr;
const Input *volatile running = nullptr;
volatile uint64_t runs = 0;

// ---- What ends the process is kept. Writing every input before it runs would take longer than running it.

void keep_last() {
    const Input *input = running;
    const int file =
        last_path != nullptr && input != nullptr ? open(last_path, O_WRONLY | O_CREAT | O_TRUNC, 0644) : -1;
    if (file >= 0) {
        const ssize_t written = write(file, input->data(), input->size());
        static_cast<void>(written);
        close(file);
    }
}

void on_signal(int number) {
    static volatile uint64_t seen = UINT64_MAX;
    if (number == SIGALRM && (seen != runs || running == nullptr)) {
        seen = runs;
        return; // another input than last time: nothing hangs
    }
    keep_last();
    std::signal(number, SIG_DFL);
    std::raise(number);
}

void keep_what_ends_us(unsigned hang_s) {
    std::signal(SIGABRT, on_signal);
    std::signal(SIGILL, on_signal); // an invariant of the core
    std::signal(SIGALRM, on_signal);
    if (__sanitizer_set_death_callback != nullptr) {
        __sanitizer_set_death_callback(keep_last);
    } else {
        std::signal(SIGSEGV, on_signal);
        std::signal(SIGFPE, on_signal);
    }
    const timeval period{static_cast<time_t>(hang_s), 0};
    const itimerval timer{period, period};
    setitimer(ITIMER_REAL, &timer, nullptr);
}

void run(const Input &input) {
    runs = runs + 1;
    running = &input;
    LLVMFuzzerTestOneInput(input.data(), input.size());
    running = nullptr;
}

// ---- Inputs

Input fresh(fuzz::Generator &random, size_t longest) {
    Input input(1 + random.below(random.below(4) == 0 ? longest : std::max<size_t>(longest / 10, 1)));
    std::generate(input.begin(), input.end(), [&random] { return static_cast<uint8_t>(random.next() >> 56); });
    return input;
}

void mutate(Input *input, fuzz::Generator &random) {
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

/// Inputs one after another, each fresh or made from one before.
class Inputs {
public:
    Inputs(uint64_t seed, size_t longest) : random_(seed), longest_(longest) {}

    const Input &next() {
        const bool anew = kept_.empty() || random_.below(2) == 0;
        if (LLVMFuzzerCustomMutator != nullptr) {
            custom(anew);
        } else {
            input_ = anew ? fresh(random_, longest_) : kept_[random_.below(kept_.size())];
            mutate(&input_, random_);
        }
        return input_;
    }
    /// Some of what ran is kept, to make others from it.
    void ran() {
        if (kept_.size() < kept_inputs) {
            kept_.push_back(input_);
        } else if (random_.below(16) == 0) {
            kept_[random_.below(kept_.size())] = input_;
        }
    }

private:
    void custom(bool anew) {
        input_ = anew ? Input{} : kept_[random_.below(kept_.size())];
        const size_t size = input_.size();
        input_.resize(std::max(longest_, size));
        input_.resize(
            LLVMFuzzerCustomMutator(input_.data(), size, input_.size(), static_cast<unsigned>(random_.next())));
    }

    fuzz::Generator random_;
    size_t longest_;
    std::vector<Input> kept_;
    Input input_;
};

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

void run_bytes(uint64_t seed, uint64_t bytes) {
    constexpr size_t longest = 8000;
    Inputs inputs(seed, longest);
    while (fuzz::figures().bytes < bytes) {
        run(inputs.next());
        inputs.ran();
    }
}

void run_block(uint64_t seed, uint64_t block, uint64_t count, size_t longest) {
    Inputs inputs(fuzz::Generator(seed + (block << 32)).next(), longest);
    for (; count > 0; --count) {
        run(inputs.next());
        inputs.ran();
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
    const char *patience = std::getenv("FUZZ_HANG_S");
    uint64_t hang_s = 10;
    if (patience != nullptr && !number_of(patience, &hang_s)) {
        std::fprintf(stderr, "FUZZ_HANG_S=%s is no number of seconds\n", patience);
        return 2;
    }
    keep_what_ends_us(static_cast<unsigned>(hang_s));
    uint64_t numbers[4] = {};
    int given = 0;
    while (given < 4 && given + 1 < argc && number_of(argv[given + 1], &numbers[given])) {
        ++given;
    }
    if (argc == 3 && given == 2) {
        run_bytes(numbers[0], numbers[1]);
        return 0;
    }
    if (argc == 5 && given == 4 && numbers[3] > 0) {
        run_block(numbers[0], numbers[1], numbers[2], numbers[3]);
        return 0;
    }
    if (argc > 1) {
        return run_files(argc - 1, argv + 1);
    }
    std::fprintf(stderr, "usage: %s SEED BYTES | SEED BLOCK COUNT LONGEST | FILE...\n", argv[0]);
    return 2;
}
