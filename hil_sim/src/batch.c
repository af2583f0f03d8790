/* SPDX-License-Identifier: MIT */
#include "hil_sim/batch.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "hil_sim/lanes.h"

enum { LANES_PAY = 4 /* runs from which on they take less time in lanes than one by one */ };

typedef struct slot_t {
    hil_run_t run;
    hil_player_t player;
    uint64_t left; /* ticks to the player's next look; 0: the run is over */
} slot_t;

typedef struct block_t {
    const hil_scenario_t *scenario;
    slot_t slot[HIL_BLOCK];
    hil_path_t path;
    hil_moment_t moments[]; /* per slot, one after the other */
} block_t;

static void without_figures(hil_figures_t *row, const hil_player_t *player) {
    static const hil_metrics_t nothing = {.milestones = {.done_us = UINT64_MAX}};
    hil_figures_from_metrics(row, &nothing, player->scenario->world->wheels);
    row->faults = player->status == HIL_RUN_ARMING ? (uint32_t)player->detail : 0;
}

static void finish(const slot_t *slot, hil_figures_t *row) {
    row->status = slot->player.status;
    row->ticks = slot->player.status == HIL_RUN_WORLD ? 0 : slot->run.ticks;
    if (row->status == HIL_RUN_OK) {
        hil_figures_from_metrics(row, &slot->run.metrics, slot->run.world.config.wheels);
    } else {
        without_figures(row, &slot->player);
    }
}

static void go_on(slot_t *slot, hil_figures_t *row) {
    slot->left = hil_player_due(&slot->player);
    if (slot->left == 0) {
        finish(slot, row);
    }
}

static void start(block_t *block, uint32_t number, hil_figures_t *row) {
    slot_t *slot = &block->slot[number];
    hil_moment_t *moments = block->moments + (size_t)number * block->scenario->event_count;
    hil_player_init(&slot->player, block->scenario, row->seed, &slot->run, moments, &block->path);
    go_on(slot, row);
}

/* To the first look that any run of the block needs; 0: all are over. */
static uint64_t next_piece(const block_t *block, uint32_t runs) {
    uint64_t piece = 0;
    for (uint32_t i = 0; i < runs; i++) {
        const uint64_t left = block->slot[i].left;
        piece = left > 0 && (piece == 0 || left < piece) ? left : piece;
    }
    return piece;
}

static void advance(block_t *block, uint32_t runs, uint64_t piece) {
    hil_run_t *going[HIL_BLOCK] = {NULL};
    uint32_t count = 0;
    for (uint32_t i = 0; i < runs; i++) {
        if (block->slot[i].left > 0) {
            going[count++] = &block->slot[i].run;
        }
    }
    for (uint32_t i = count; i < HIL_BLOCK; i++) {
        /* cppcheck-suppress uninitvar ; all of it is initialised */
        going[i] = going[0];
    }
    const uint64_t together = count < LANES_PAY ? 0 : hil_lanes_advance(going, piece);
    for (uint32_t i = 0; i < count && together < piece; i++) {
        hil_run_advance(going[i], piece - together);
    }
}

static void look(block_t *block, uint32_t runs, uint64_t piece, hil_figures_t *rows) {
    for (uint32_t i = 0; i < runs; i++) {
        slot_t *slot = &block->slot[i];
        if (slot->left == 0) {
            continue;
        }
        slot->left -= piece;
        if (slot->left == 0) {
            hil_player_update(&slot->player);
            go_on(slot, &rows[i]);
        }
    }
}

static bool cancelled(const volatile int32_t *cancel) {
    return cancel != NULL && *cancel != 0;
}

static bool run_block(block_t *block, uint32_t runs, hil_figures_t *rows, const volatile int32_t *cancel) {
    for (uint32_t i = 0; i < runs; i++) {
        start(block, i, &rows[i]);
    }
    for (uint64_t piece = next_piece(block, runs); piece > 0; piece = next_piece(block, runs)) {
        if (cancelled(cancel)) {
            return false;
        }
        advance(block, runs, piece);
        look(block, runs, piece, rows);
    }
    return true;
}

int64_t hil_batch_run(const hil_scenario_t *scenario, uint64_t first_seed, uint32_t count, hil_figures_t *rows,
                      const volatile int32_t *cancel) {
    block_t *block = malloc(sizeof *block + (size_t)HIL_BLOCK * scenario->event_count * sizeof(hil_moment_t));
    if (block == NULL) {
        return -1;
    }
    block->scenario = scenario;
    block->path.known = false;
    memset(rows, 0, count * sizeof *rows);
    uint32_t done = 0;
    bool going = true;
    while (going && done < count) {
        const uint32_t runs = count - done < HIL_BLOCK ? count - done : HIL_BLOCK;
        for (uint32_t i = 0; i < runs; i++) {
            rows[done + i].seed = first_seed + done + i;
        }
        going = run_block(block, runs, rows + done, cancel);
        done += going ? runs : 0;
    }
    free(block);
    return (int64_t)done;
}
