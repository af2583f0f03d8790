/* SPDX-License-Identifier: MIT */
/** @file omni.h  The whole control core. */
#ifndef OMNI_OMNI_H
#define OMNI_OMNI_H

#include "omni/bridge.h"
#include "omni/current.h"
#include "omni/direct_torque.h"
#include "omni/feedback_linearization.h"
#include "omni/flow.h"
#include "omni/gyro.h"
#include "omni/ismc.h"
#include "omni/kinematics.h"
#include "omni/loop.h"
#include "omni/math.h"
#include "omni/motor.h"
#include "omni/motor_kf.h"
#include "omni/original_law.h"
#include "omni/params.h"
#include "omni/pid.h"
#include "omni/pose_ekf.h"
#include "omni/robot.h"
#include "omni/safety.h"
#include "omni/saturation.h"
#include "omni/torque_curve.h"
#include "omni/trajectory.h"
#include "omni/types.h"
#include "omni/wheel_speed.h"

#endif
