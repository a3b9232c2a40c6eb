/*
 * Corrects set-points of an arm as a controller would: one by one, and as a stream.
 *
 * Usage: correct CALIB Q1 ... QN     readings in rad (m for prismatic joints)
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "truearm.h"

enum { MOST_JOINTS = 16, CYCLES = 700 };

static int failed(const char *what, truearm_status status, const char *message)
{
    fprintf(stderr, "%s: %s\n", what, *message ? message : truearm_status_text(status));
    return EXIT_FAILURE;
}

static void print_readings(const char *name, const double *q, size_t joints)
{
    printf("%s", name);
    for (size_t j = 0; j < joints; j++) {
        printf(" %.17g", q[j]);
    }
    printf("\n");
}

/* One waypoint: what it should be, or why it must not be corrected. */
static int correct_one(const truearm_corrector *corrector, const double *q, size_t joints)
{
    truearm_workspace *workspace = NULL;
    double corrected[MOST_JOINTS], position[3];
    truearm_correction correction;
    truearm_status status = truearm_workspace_new(corrector, &workspace);
    if (status == TRUEARM_STATUS_OK) {
        status = truearm_correct(corrector, workspace, q, joints, NULL, 0, corrected, joints, &correction);
    }
    if (status == TRUEARM_STATUS_OK) {
        status = truearm_predict_position(corrector, workspace, corrected, joints, NULL, 0, position, 3);
    }
    truearm_workspace_free(workspace);
    if (status == TRUEARM_STATUS_REFUSED) {
        printf("refused %" PRIu32 ": %s\n", correction.reason, truearm_reason_text(correction.reason));
        return EXIT_SUCCESS;
    }
    if (status != TRUEARM_STATUS_OK) {
        return failed("truearm_correct", status, "");
    }
    print_readings("corrected", corrected, joints);
    print_readings("position", position, 3);
    printf("std %.17g\n", correction.std_m);
    return EXIT_SUCCESS;
}

/* Where no set-point has come yet a stream writes nothing, and waits for one. */
static int may_go_on(truearm_status status)
{
    return status >= TRUEARM_STATUS_OK || status == TRUEARM_STATUS_NOT_STARTED;
}

/* A stream at 500 Hz that rests at one set-point: the correction ramps up in a second. */
static int correct_stream(const truearm_corrector *corrector, const double *q, size_t joints)
{
    truearm_stream *stream = NULL;
    truearm_stream_state state = {0, 0, 0.0, 0.0};
    double command[MOST_JOINTS];
    char message[256] = "";
    truearm_status status = truearm_stream_new(corrector, NULL, &stream, message, sizeof message);
    for (int cycle = 0; cycle < CYCLES && may_go_on(status); cycle++) {
        status = truearm_stream_step(stream, q, joints, NULL, 0, 0.002, command, joints, &state);
    }
    truearm_stream_free(stream);
    if (status < TRUEARM_STATUS_OK) {
        return failed("truearm_stream_step", status, message);
    }
    print_readings("streamed", command, joints);
    printf("phase %" PRIu32 " gain %g\n", state.phase, state.gain);
    return EXIT_SUCCESS;
}

int main(int count, char **words)
{
    truearm_calibration *calibration = NULL;
    truearm_corrector *corrector = NULL;
    char message[256] = "";
    double q[MOST_JOINTS];
    if (count < 2 || truearm_abi_version() != TRUEARM_ABI_VERSION) {
        fprintf(stderr, "usage: correct CALIB Q1 ... QN (library %s)\n", truearm_version());
        return 2;
    }
    truearm_status status = truearm_load_file(words[1], &calibration, message, sizeof message);
    if (status != TRUEARM_STATUS_OK) {
        return failed(words[1], status, message);
    }
    size_t joints = truearm_joint_count(calibration);
    if ((size_t)count != joints + 2 || joints > MOST_JOINTS) {
        fprintf(stderr, "%zu readings are needed\n", joints);
        truearm_calibration_free(calibration);
        return 2;
    }
    for (size_t j = 0; j < joints; j++) {
        q[j] = strtod(words[j + 2], NULL);
    }
    status = truearm_corrector_new(calibration, NULL, NULL, &corrector, message, sizeof message);
    truearm_calibration_free(calibration);
    if (status != TRUEARM_STATUS_OK) {
        return failed("truearm_corrector_new", status, message);
    }
    int result = correct_one(corrector, q, joints);
    if (result == EXIT_SUCCESS) {
        result = correct_stream(corrector, q, joints);
    }
    truearm_corrector_free(corrector);
    return result;
}
