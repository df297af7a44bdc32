/* Predictive control about hover: one constant program, solved by DAQP. Float32, no allocation.
 * World z up, body x forward, y left, z up. Quaternion x, y, z, w, body to world. Motors 1..4 front right, back right,
 * back left, front left. */
#ifndef HOVER_MPC_H
#define HOVER_MPC_H

typedef struct {
    float position_m[3], velocity_m_s[3]; /* world */
    float quaternion[4];
    float rate_rad_s[3]; /* body */
} HoverMpcState;

typedef struct {
    float position_m[3], velocity_m_s[3], acceleration_m_s2[3]; /* world */
    float yaw_rad;
    float rate_rad_s[3]; /* body */
} HoverMpcReference;

typedef enum {
    HOVER_MPC_FREE = 0,     /* no motor met a bound */
    HOVER_MPC_BOUNDED = 1,  /* the program was solved within bounds */
    HOVER_MPC_CLIPPED = 2,  /* no solution in time: the answer without bounds, clipped */
    HOVER_MPC_SINKING = 3   /* no valid state: level thrust below hover, no torque */
} HoverMpcOutcome;

/* Forgets integrals, the last valid inputs and the battery. */
void hover_mpc_reset(void);

/* One command, to be called every HOVER_MPC_PERIOD_S. wrench: thrust N and torques N m about body x, y, z, for the
 * firmware's force-torque mixer. All of it is finite for any input. */
HoverMpcOutcome hover_mpc_step(const HoverMpcState *state, const HoverMpcReference *reference, float battery_V,
                               float wrench[4]);

/* Iterations of DAQP in the last step. */
int hover_mpc_iterations(void);

#endif
