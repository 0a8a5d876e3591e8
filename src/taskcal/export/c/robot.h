/* @TITLE@
 *
 * Metres and radians; joints as the controller counts them (metres where a joint slides). Poses are three rows of four
 * numbers, rotation and position, of the tool in the robot's base. No function allocates, or keeps anything between calls.
 *
 * Calibrated from @ROWS@ rows of @CAMPAIGN@ (digest @CAMPAIGN_DIGEST@).
 * Robot: @ROBOT@ (digest @ROBOT_DIGEST@).
 * Calibration: digest @DIGEST@.@EDITED@
 * This file was made for its user, who may use and pass it on as they like.
 */
#ifndef @GUARD@_H
#define @GUARD@_H

#ifdef __cplusplus
extern "C" {
#endif

#define @GUARD@_JOINTS @JOINTS@
#define @GUARD@_BRANCHES 16 /* that @P@_inverse gives at most */

/* What functions return. */
enum {
    @GUARD@_OK = 0,
    @GUARD@_OPEN = -1,          /* the closed loop of its drive does not assemble at these joints */
    @GUARD@_NOT_A_NUMBER = -2,  /* something that was given is no finite number */
    @GUARD@_OUT_OF_REACH = -3,  /* no posture reaches the pose, limits aside */
    @GUARD@_OUT_OF_LIMITS = -4, /* the pose is reached, but not inside the joints' limits */
    @GUARD@_UNKNOWN = -5        /* an uncertainty depends on conditions that were not given */
};

/* What @P@_inverse says beside postures. */
enum {
    @GUARD@_ALL = -1,        /* there are no others */
    @GUARD@_MAY_BE_MORE = -2 /* some may be missing */
};

/* How a pose is reached, where the calibration knows what follows from it; everything unknown by a null pointer. */
typedef struct {
    double approach[@JOINTS@]; /* way in which each joint turned last: 1 up, -1 down, 0 unknown */
    double move[@JOINTS@];     /* how far each joint turned on its last way; 0 unknown */
    double temperature;        /* degrees Celsius; NaN unknown */
    double time;               /* since the robot began to work, seconds; NaN unknown */
} @P@_conditions;

extern const char @P@_digest[];                      /* of the calibration */
extern const double @P@_limits[@JOINTS@][2];         /* of the joints */

/* Pose of the tool. */
int @P@_forward(const double q[@JOINTS@], const @P@_conditions *conditions, double pose[12]);

/* The same, and its derivative by the joints: rows vx vy vz wx wy wz in the base's axes. */
int @P@_jacobian(const double q[@JOINTS@], const @P@_conditions *conditions, double pose[12], double jacobian[@SIX_JOINTS@]);

/* Joints near a start whose tool is at a pose, to 1e-10 m; in q the closest that was found where it is not reached. */
int @P@_inverse_near(const double pose[12], const @P@_conditions *conditions, const double start[@JOINTS@], double q[@JOINTS@]);

/* Postures that reach a pose inside the limits, each once: whole turns of a joint aside, of which the nearest to the middle of
 * its limits is given. Returns how many, 0 if none was found and some may be missing, or why there is none. said, if not null:
 * with postures ALL or MAY_BE_MORE; else the number of the first joint that keeps a posture from the limits, or -1. @INVERSE@ */
int @P@_inverse(const double pose[12], const @P@_conditions *conditions, double q[@GUARD@_BRANCHES][@JOINTS@], int *said);

/* Covariance (3 by 3, metres squared, the base's axes) of a point fixed to the tool (in the tool, metres) about where it is
 * predicted, what geometry leaves at a single pose included; to @PACKED@ of its standard deviations.
 * outside, if not null: how far beyond the measured joint range, in ranges; 0 inside. */
int @P@_uncertainty(const double q[@JOINTS@], const @P@_conditions *conditions, const double point[3], double covariance[9], double *outside);

#ifdef __cplusplus
}
#endif
#endif
