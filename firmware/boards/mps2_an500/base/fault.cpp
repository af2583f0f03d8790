// SPDX-License-Identifier: MIT
#include "base/fault.h"

#include <cstddef>

#include "base/machine.h"
#include "base/semihosting.h"

extern "C" {
extern uint32_t an500_stack_limit[];
}

namespace an500 {
namespace {

const char *kind(uint32_t exception) {
    constexpr const char *names[] = {"NMI", "HardFault", "MemManage", "BusFault", "UsageFault"};
    return exception >= 2 && exception <= 6 ? names[exception - 2] : "unexpected interrupt";
}

/// A line made without anything that might fault again.
class Line {
public:
    Line &add(const char *text) {
        while (*text != '\0' && length_ + 1 < sizeof text_) {
            text_[length_++] = *text++;
        }
        return *this;
    }
    Line &add(const char *name, uint32_t value) {
        add(name);
        char digits[] = "00000000";
        for (size_t i = 8; i-- > 0; value >>= 4) {
            digits[i] = "0123456789abcdef"[value & 0xF];
        }
        return add(digits);
    }
    const char *text() {
        text_[length_] = '\0';
        return text_;
    }

private:
    char text_[80] = {};
    size_t length_ = 0;
};

void print_line(const char *text) {
    semihosting_print("omni-firmware: ");
    semihosting_print(text);
    semihosting_print("\n");
}

} // namespace

void describe_fault(const Fault &fault, void (*line)(const char *text)) {
    line(Line().add(kind(fault.exception)).add(" at pc ", fault.pc).add(" lr ", fault.lr).text());
    line(Line().add("cfsr ", fault.cfsr).add(" hfsr ", fault.hfsr).text());
    line(Line().add("mmfar ", fault.mmfar).add(" bfar ", fault.bfar).add(" xpsr ", fault.xpsr).text());
    line(Line().add("r0 ", fault.r0).add(" r1 ", fault.r1).add(" r2 ", fault.r2).text());
    line(Line().add("r3 ", fault.r3).add(" r12 ", fault.r12).text());
}

extern "C" [[gnu::weak]] void an500_fault(const Fault &fault) {
    describe_fault(fault, print_line);
    semihosting_exit(fault_exit_code);
}

/// From the fault vectors. @param frame where the hardware pushed the registers; out of the stack after it ran over.
extern "C" [[noreturn, gnu::used]] void an500_take_fault(const uint32_t *frame, uint32_t exception) {
    static Fault fault;
    if (frame >= an500_stack_limit) {
        fault = {frame[0], frame[1], frame[2], frame[3], frame[4], frame[5], frame[6], frame[7], 0, 0, 0, 0, 0};
    }
    fault.exception = exception;
    fault.cfsr = at(0xE000ED28);
    fault.hfsr = at(0xE000ED2C);
    fault.mmfar = at(0xE000ED34);
    fault.bfar = at(0xE000ED38);
    an500_fault(fault);
}

} // namespace an500
