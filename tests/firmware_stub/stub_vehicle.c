/* What surrounds the controller in a vehicle, for tests: called from Python with plain arrays. */
#include "firmware_stub.h"

static float battery_V = 3.7f;
static int handed_over;

void vTaskDelay(uint32_t ticks) { (void)ticks; }
float pmGetBatteryVoltage(void) { return battery_V; }
void controllerPidInit(void) {}
bool controllerPidTest(void) { return true; }
void controllerPid(control_t *control, const setpoint_t *setpoint, const sensorData_t *sensors, const state_t *state,
                   const stabilizerStep_t step) {
    (void)setpoint, (void)sensors, (void)state, (void)step;
    handed_over++;
    control->controlMode = controlModeLegacy;
}

/* estimate: position, velocity, quaternion x y z w, gyro deg/s (13). goal: position, velocity, acceleration, yaw deg,
 * rates deg/s (13), quaternion (4). modes: x, y, z, yaw, quat. out: thrust and torques. Counts the PID's turns. */
int stub_step(uint32_t step, const float *estimate, const float *goal, const int *modes, float volts, float *out) {
    control_t control = {0};
    setpoint_t s = {0};
    state_t x = {0};
    sensorData_t sensors = {0};
    const float *e = estimate, *g = goal;
    x.position = (point_t){0, e[0], e[1], e[2]};
    x.velocity = (point_t){0, e[3], e[4], e[5]};
    x.attitudeQuaternion = (quaternion_t){0, e[6], e[7], e[8], e[9]};
    sensors.gyro = (Axis3f){e[10], e[11], e[12]};
    s.position = (point_t){0, g[0], g[1], g[2]};
    s.velocity = (point_t){0, g[3], g[4], g[5]};
    s.acceleration = (point_t){0, g[6], g[7], g[8]};
    s.attitude.yaw = g[9];
    s.attitudeRate = (attitude_t){0, g[10], g[11], g[12]};
    s.attitudeQuaternion = (quaternion_t){0, g[13], g[14], g[15], g[16]};
    s.mode.x = (stab_mode_t)modes[0];
    s.mode.y = (stab_mode_t)modes[1];
    s.mode.z = (stab_mode_t)modes[2];
    s.mode.yaw = (stab_mode_t)modes[3];
    s.mode.quat = (stab_mode_t)modes[4];
    battery_V = volts;
    handed_over = 0;
    controllerOutOfTree(&control, &s, &sensors, &x, step);
    out[0] = control.thrustSi;
    for (int i = 0; i < 3; i++) out[1 + i] = control.torque[i];
    return handed_over;
}
