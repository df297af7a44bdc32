/* Error-state Kalman filter on IMU, poses and drag. Float32, no allocation.
 * World z up, body x forward, y left, z up. Quaternion x, y, z, w, body to world. */
#ifndef DRAG_FILTER_H
#define DRAG_FILTER_H

#include <stdbool.h>

typedef struct {
    float position_m[3], velocity_m_s[3]; /* world */
    float quaternion[4];
} DragFilterState;

typedef struct {
    float position_m[3], quaternion[4]; /* of the tracked body */
    float age_s;                        /* how long before this row it was measured; negative after it */
} DragFilterPose;

/* Starts at rest at a pose. False, and nothing happens, for one that is invalid. */
bool drag_filter_start(const DragFilterPose *pose);

/* True from a start until an invalid state, after which it has to be started again. */
bool drag_filter_running(void);

/* One row of the IMU, dt_s after the last, and the poses that came since. acc m/s^2 (specific force) and gyro rad/s in
 * the body; flying: drag counts. Invalid rows are left out and their time added to the next; invalid poses are left
 * out. out is finite, and the last valid state where the filter does not run. */
void drag_filter_step(float dt_s, const float acc[3], const float gyro[3], bool flying, const DragFilterPose *poses,
                      int count, DragFilterState *out);

#endif
