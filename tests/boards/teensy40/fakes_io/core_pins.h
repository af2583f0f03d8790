// SPDX-License-Identifier: MIT
/// @file core_pins.h  Stands in for Teensyduino's: registers as objects that tell a model of the chip what was done to
/// them.
#pragma once

#include <cstdint>

namespace fake {

/// A memory-mapped register. Without hooks it is plain memory.
struct Register {
    uint32_t value = 0;
    uint32_t (*on_read)(uint32_t value) = nullptr;
    void (*on_write)(uint32_t value) = nullptr;

    Register() = default;
    Register(const Register &) = delete;
    operator uint32_t() const { return on_read != nullptr ? on_read(value) : value; }
    Register &operator=(uint32_t written) {
        if (on_write != nullptr) {
            on_write(written);
        } else {
            value = written;
        }
        return *this;
    }
};

struct Pin {
    Register *port;
    uint32_t mask;
    Register *mux;
    Register *pad;
};

extern const Pin pins[40];
/// CCM, IOMUXC and other registers that only hold what was written.
extern Register ccm_ccgr2, ccm_ccgr4, ccm_cscdr2, daisy[26], sda_daisy, scl_daisy, sda3_daisy, scl3_daisy, sda4_daisy,
    scl4_daisy, ccm_ccgr6;
extern uint32_t cycles;

void attach(int irq, void (*function)());
void enable(int irq);
void set_priority(int irq, uint8_t priority);

} // namespace fake

#define portOutputRegister(pin) (fake::pins[(pin)].port + 0)
#define portModeRegister(pin) (fake::pins[(pin)].port + 1)
#define portInputRegister(pin) (fake::pins[(pin)].port + 2)
#define portClearRegister(pin) (fake::pins[(pin)].port + 34)
#define digitalPinToBitMask(pin) (fake::pins[(pin)].mask)
#define portConfigRegister(pin) (fake::pins[(pin)].mux)
#define portControlRegister(pin) (fake::pins[(pin)].pad)

#define IOMUXC_PAD_HYS (1u << 16)
#define IOMUXC_PAD_PUS(n) (((n)&3u) << 14)
#define IOMUXC_PAD_PUE (1u << 13)
#define IOMUXC_PAD_PKE (1u << 12)
#define IOMUXC_PAD_ODE (1u << 11)
#define IOMUXC_PAD_DSE(n) (((n)&7u) << 3)
#define IOMUXC_XBAR1_IN06_SELECT_INPUT fake::daisy[6]
#define IOMUXC_XBAR1_IN07_SELECT_INPUT fake::daisy[7]
#define IOMUXC_XBAR1_IN08_SELECT_INPUT fake::daisy[8]
#define IOMUXC_XBAR1_IN09_SELECT_INPUT fake::daisy[9]
#define IOMUXC_XBAR1_IN14_SELECT_INPUT fake::daisy[14]
#define IOMUXC_XBAR1_IN15_SELECT_INPUT fake::daisy[15]
#define IOMUXC_XBAR1_IN17_SELECT_INPUT fake::daisy[17]
#define IOMUXC_XBAR1_IN22_SELECT_INPUT fake::daisy[22]
#define IOMUXC_XBAR1_IN23_SELECT_INPUT fake::daisy[23]
#define IOMUXC_LPI2C1_SDA_SELECT_INPUT fake::sda_daisy
#define IOMUXC_LPI2C1_SCL_SELECT_INPUT fake::scl_daisy
#define IOMUXC_LPI2C3_SDA_SELECT_INPUT fake::sda3_daisy
#define IOMUXC_LPI2C3_SCL_SELECT_INPUT fake::scl3_daisy
#define IOMUXC_LPI2C4_SDA_SELECT_INPUT fake::sda4_daisy
#define IOMUXC_LPI2C4_SCL_SELECT_INPUT fake::scl4_daisy
#define CCM_CCGR2 fake::ccm_ccgr2
#define CCM_CCGR4 fake::ccm_ccgr4
#define CCM_CCGR6 fake::ccm_ccgr6
#define CCM_CSCDR2 fake::ccm_cscdr2
#define CCM_CCGR_ON 3u
#define CCM_CCGR2_XBAR1(n) ((n) << 22)
#define CCM_CCGR2_LPI2C1(n) ((n) << 6)
#define CCM_CCGR2_LPI2C3(n) ((n) << 10)
#define CCM_CCGR6_LPI2C4_SERIAL(n) ((n) << 24)
#define CCM_CCGR4_ENC1(n) ((n) << 24)
#define CCM_CCGR4_ENC2(n) ((n) << 26)
#define CCM_CCGR4_ENC3(n) ((n) << 28)
#define CCM_CCGR4_ENC4(n) ((n) << 30)
#define CCM_CSCDR2_LPI2C_CLK_SEL (1u << 18)
#define XBARA1_OUT_ENC1_PHASEA_INPUT 66
#define XBARA1_OUT_ENC2_PHASEA_INPUT 71
#define F_CPU_ACTUAL 600000000u
#define ARM_DWT_CYCCNT fake::cycles

enum IRQ_NUMBER_t { IRQ_LPI2C1 = 28, IRQ_LPI2C3 = 30, IRQ_LPI2C4 = 31, IRQ_GPIO6789 = 157 };
#define attachInterruptVector fake::attach
#define NVIC_ENABLE_IRQ fake::enable
#define NVIC_SET_PRIORITY fake::set_priority

struct IMXRT_ENC_t {
    fake::Register CTRL, FILT, CTRL2, UPOS, LPOS, LPOSH;
};
extern IMXRT_ENC_t IMXRT_ENC1, IMXRT_ENC2, IMXRT_ENC3, IMXRT_ENC4;

struct IMXRT_LPI2C_t {
    fake::Register MCR, MSR, MIER, MCFGR0, MCFGR1, MCFGR2, MCFGR3, MCCR0, MFCR, MFSR, MTDR, MRDR;
};
extern IMXRT_LPI2C_t IMXRT_LPI2C1, IMXRT_LPI2C3, IMXRT_LPI2C4;

#define LPI2C_MCR_RRF (1u << 9)
#define LPI2C_MCR_RTF (1u << 8)
#define LPI2C_MCR_RST (1u << 1)
#define LPI2C_MCR_MEN (1u << 0)
#define LPI2C_MSR_BBF (1u << 25)
#define LPI2C_MSR_MBF (1u << 24)
#define LPI2C_MSR_DMF (1u << 14)
#define LPI2C_MSR_PLTF (1u << 13)
#define LPI2C_MSR_FEF (1u << 12)
#define LPI2C_MSR_ALF (1u << 11)
#define LPI2C_MSR_NDF (1u << 10)
#define LPI2C_MSR_SDF (1u << 9)
#define LPI2C_MSR_EPF (1u << 8)
#define LPI2C_MSR_RDF (1u << 1)
#define LPI2C_MSR_TDF (1u << 0)
#define LPI2C_MIER_FEIE (1u << 12)
#define LPI2C_MIER_ALIE (1u << 11)
#define LPI2C_MIER_NDIE (1u << 10)
#define LPI2C_MIER_SDIE (1u << 9)
#define LPI2C_MIER_RDIE (1u << 1)
#define LPI2C_MIER_TDIE (1u << 0)
#define LPI2C_MCFGR1_PRESCALE(n) ((n)&7u)
#define LPI2C_MCFGR2_FILTSDA(n) (((n)&0xFu) << 24)
#define LPI2C_MCFGR2_FILTSCL(n) (((n)&0xFu) << 16)
#define LPI2C_MCFGR2_BUSIDLE(n) ((n)&0xFFFu)
#define LPI2C_MCCR0_DATAVD(n) (((n)&0x3Fu) << 24)
#define LPI2C_MCCR0_SETHOLD(n) (((n)&0x3Fu) << 16)
#define LPI2C_MCCR0_CLKHI(n) (((n)&0x3Fu) << 8)
#define LPI2C_MCCR0_CLKLO(n) ((n)&0x3Fu)
#define LPI2C_MFCR_RXWATER(n) (((n)&3u) << 16)
#define LPI2C_MFCR_TXWATER(n) ((n)&3u)
#define LPI2C_MTDR_CMD_TRANSMIT (0u << 8)
#define LPI2C_MTDR_CMD_RECEIVE (1u << 8)
#define LPI2C_MTDR_CMD_STOP (2u << 8)
#define LPI2C_MTDR_CMD_START (4u << 8)
