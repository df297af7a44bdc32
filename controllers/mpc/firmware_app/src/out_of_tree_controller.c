/* Out-of-tree controller of the Crazyflie firmware around hover_mpc.c. Set-points that are not absolute in x, y, z and
 * heading are handed over to the firmware's PID controller: manual flight, velocities, levelling out, standing still. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "FreeRTOS.h"
#include "app.h"
#include "controller.h"
#include "controller_pid.h"
#include "log.h"
#include "pm.h"
#include "stabilizer_types.h"
#include "task.h"

#include "hover_mpc.h"
#include "vehicle_parameters.h"

#define RAD 0.01745329252f /* rad in a degree */

static float wrench[4];
static uint8_t outcome, iterations, handed_over = 1;

void appMain(void) {
    while (1) vTaskDelay(M2T(2000));
}

void controllerOutOfTreeInit(void) {
    controllerPidInit();
    hover_mpc_reset();
    handed_over = 1;
}

bool controllerOutOfTreeTest(void) { return controllerPidTest(); }

static bool follows(const setpoint_t *s) {
    return s->mode.x == modeAbs && s->mode.y == modeAbs && s->mode.z == modeAbs &&
           (s->mode.yaw == modeAbs || s->mode.quat == modeAbs);
}

static float heading(const setpoint_t *s) {
    if (s->mode.yaw == modeAbs) return s->attitude.yaw * RAD;
    const float x = s->attitudeQuaternion.x, y = s->attitudeQuaternion.y;
    const float z = s->attitudeQuaternion.z, w = s->attitudeQuaternion.w;
    return atan2f(2.0f * (x * y + w * z), w * w + x * x - y * y - z * z);
}

static void run(const setpoint_t *setpoint, const sensorData_t *sensors, const state_t *state) {
    const HoverMpcState now = {
        {state->position.x, state->position.y, state->position.z},
        {state->velocity.x, state->velocity.y, state->velocity.z},
        {state->attitudeQuaternion.x, state->attitudeQuaternion.y, state->attitudeQuaternion.z,
         state->attitudeQuaternion.w},
        {sensors->gyro.x * RAD, sensors->gyro.y * RAD, sensors->gyro.z * RAD}};
    const HoverMpcReference goal = {
        {setpoint->position.x, setpoint->position.y, setpoint->position.z},
        {setpoint->velocity.x, setpoint->velocity.y, setpoint->velocity.z},
        {setpoint->acceleration.x, setpoint->acceleration.y, setpoint->acceleration.z},
        heading(setpoint),
        {setpoint->attitudeRate.roll * RAD, setpoint->attitudeRate.pitch * RAD, setpoint->attitudeRate.yaw * RAD}};
    outcome = (uint8_t)hover_mpc_step(&now, &goal, pmGetBatteryVoltage(), wrench);
    iterations = (uint8_t)hover_mpc_iterations();
}

void controllerOutOfTree(control_t *control, const setpoint_t *setpoint, const sensorData_t *sensors,
                         const state_t *state, const stabilizerStep_t stabilizerStep) {
    if (!follows(setpoint)) {
        handed_over = 1;
        controllerPid(control, setpoint, sensors, state, stabilizerStep);
        return;
    }
    if (RATE_DO_EXECUTE(HOVER_MPC_RATE_HZ, stabilizerStep)) {
        if (handed_over) hover_mpc_reset();
        handed_over = 0;
        run(setpoint, sensors, state);
    } else if (handed_over) { /* the first command comes in the next step */
        controllerPid(control, setpoint, sensors, state, stabilizerStep);
        return;
    }
    control->controlMode = controlModeForceTorque;
    control->thrustSi = wrench[0];
    for (int i = 0; i < 3; i++) control->torque[i] = wrench[1 + i];
}

LOG_GROUP_START(ctrlHoverMpc)
LOG_ADD(LOG_UINT8, outcome, &outcome)
LOG_ADD(LOG_UINT8, iterations, &iterations)
LOG_ADD(LOG_UINT8, handedOver, &handed_over)
LOG_ADD(LOG_FLOAT, thrust, &wrench[0])
LOG_GROUP_STOP(ctrlHoverMpc)
