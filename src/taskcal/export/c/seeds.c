/* The nominal robot has no closed form here: starts from all over the joint ranges. */

#define STARTS @SEED_COUNT@
static const double seeds[STARTS][JOINTS] = @SEEDS@;
static const double @P@_limits_middle[JOINTS] = @MIDDLE@;

static int begin(const double *pose, double starts[STARTS][JOINTS]) {
    (void)pose;
    memcpy(starts, seeds, sizeof seeds);
    return STARTS;
}
