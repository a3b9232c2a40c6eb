/*
 * truearm: corrections and predictions of a calibrated robot arm, for controllers.
 *
 * A calibration is loaded once, and a corrector made for a tool. From then on nothing allocates, locks, logs
 * or aborts. Lengths are metres, angles radians, matrices row by row; readings are what the controller shows.
 * Loaded calibrations and correctors never change and may be used by any number of threads at once. Each thread
 * needs a workspace of its own, each robot a stream of its own.
 *
 * C99 or C++11 at least. Threads need 64 kB of stack at least, and round to nearest, as they do unless
 * fesetround() was called.
 *
 * Made by cbindgen from the Rust sources; see docs/reference/c-library.md.
 */

#ifndef TRUEARM_H
#define TRUEARM_H

#include <stddef.h>
#include <stdint.h>

// Version of this interface; a program compares it with truearm_abi_version().
#define TRUEARM_ABI_VERSION 1

// What a function returns: zero done, positive done with a remark, negative not done.
enum truearm_status
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    // Done.
    TRUEARM_STATUS_OK = 0,
    // The set-point has no correction of its own; the last one is held or ramped down, and is in the output.
    TRUEARM_STATUS_HELD = 1,
    // The waypoint must not be corrected; the output is not written.
    TRUEARM_STATUS_REFUSED = 2,
    // A pointer is null or not aligned.
    TRUEARM_STATUS_BAD_POINTER = -1,
    // An array has another length than the arm or the calibration's features need.
    TRUEARM_STATUS_WRONG_SIZE = -2,
    // A reading or a feature is NaN or infinite, or so large that the result is; the output is not written.
    TRUEARM_STATUS_NOT_FINITE = -3,
    // A handle is of another kind or was freed.
    TRUEARM_STATUS_BAD_HANDLE = -4,
    // Another thread is using this workspace or stream.
    TRUEARM_STATUS_BUSY = -5,
    // The file cannot be read.
    TRUEARM_STATUS_UNREADABLE = -6,
    // The file is no calibration.
    TRUEARM_STATUS_NOT_A_CALIBRATION = -7,
    // The calibration is cut short, altered or contradicts itself.
    TRUEARM_STATUS_ALTERED = -8,
    // The calibration has a layout that this library does not know.
    TRUEARM_STATUS_UNKNOWN_LAYOUT = -9,
    // An option breaks its rule.
    TRUEARM_STATUS_BAD_OPTION = -10,
    // There was no set-point yet, so there is nothing to give out.
    TRUEARM_STATUS_NOT_STARTED = -11,
    // A mistake in this library.
    TRUEARM_STATUS_INTERNAL = -12,
    // The workspace was made for another corrector.
    TRUEARM_STATUS_OTHER_WORKSPACE = -13,
    // The calibration is whole, but its model is none that this library knows: constant and variable ones.
    TRUEARM_STATUS_UNKNOWN_MODEL = -14,
    // The thread does not round to nearest, without which numbers would be wrong: fesetround(FE_TONEAREST).
    TRUEARM_STATUS_BAD_ROUNDING = -15,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum truearm_status truearm_status;
#else
typedef int32_t truearm_status;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// A loaded calibration.
typedef struct truearm_calibration truearm_calibration;

// A calibration and a tool, ready to correct and predict.
typedef struct truearm_corrector truearm_corrector;

// Corrections of one robot's set-points.
typedef struct truearm_stream truearm_stream;

// Memory of one thread.
typedef struct truearm_workspace truearm_workspace;

// What is corrected, and how far; infinity switches a bound off.
typedef struct {
    // 0: position and orientation; 1: position and tool axis; 2: position.
    uint32_t task;
    // Bit j: joint j, from 0, may move; 0: all may.
    uint64_t moving;
    // Largest change of a revolute joint, rad.
    double largest_angle_rad;
    // Largest change of a prismatic joint, m.
    double largest_slide_m;
    // Largest shift of the tool, m.
    double largest_shift_m;
    // Largest turn of the tool, rad.
    double largest_turn_rad;
    // Largest standard deviation of the tool's position, m.
    double largest_std_m;
} truearm_options;

// How the correction of a stream may change.
typedef struct {
    // Largest rate of a revolute joint's correction, rad/s.
    double rate_rad_s;
    // Largest rate of a prismatic joint's correction, m/s.
    double rate_m_s;
    // Largest acceleration of a revolute joint's correction, rad/s^2.
    double acceleration_rad_s2;
    // Largest acceleration of a prismatic joint's correction, m/s^2.
    double acceleration_m_s2;
    // How long the ramp takes from nothing to the whole correction, s.
    double ramp_s;
    // How long the last correction is held before it is ramped down, s.
    double hold_s;
    // Longest time between two set-points, s.
    double deadline_s;
} truearm_stream_options;

// What became of a waypoint.
typedef struct {
    // How far from its target the calibrated model puts the tool, m.
    double residual_m;
    // How far it is turned from it, rad.
    double residual_rad;
    // How far the command moves: shift of the tool, base frame, m.
    double shift_m[3];
    // The same of its turn: a rotation vector, base frame, rad.
    double turn_rad[3];
    // Bound of the standard deviation of the tool's position, m; NaN where the calibration has none.
    double std_m;
    // 0, or why the waypoint is refused: see truearm_reason_text().
    uint32_t reason;
    // Joint from 1 that it is about, or 0.
    uint32_t joint;
    // What was found, m or rad; NaN where there is nothing to compare.
    double value;
    // What is allowed.
    double limit;
} truearm_correction;

// What a stream is doing.
typedef struct {
    // 0 off, 1 rising, 2 on, 3 holding, 4 falling.
    uint32_t phase;
    // 0, or why the correction is an older one: see truearm_reason_text().
    uint32_t reason;
    // Share of the correction that is aimed at, 0 to 1.
    double gain;
    // How far the applied correction is from the one aimed at: the largest of the joints, rad or m.
    double lag;
} truearm_stream_state;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// TRUEARM_ABI_VERSION of the library that is linked.
uint32_t truearm_abi_version(void);

// Version of the library, such as "0.1.0".
const char *truearm_version(void);

// A sentence about a status; never null.
const char *truearm_status_text(int32_t status);

// A sentence about the reason of a correction or of a stream's state; never null.
const char *truearm_reason_text(uint32_t reason);

// Loads a calibration file, which has to be a regular one: no pipe and no device.
//
// On failure `*out` is null and `message` (of `message_size` bytes; may be null) says what is wrong.
//
// # Safety
// `path` is a text that ends with a zero, `out` points to a pointer, `message` is null or has `message_size` bytes.
truearm_status truearm_load_file(const char *path,
                                 truearm_calibration **out,
                                 char *message,
                                 size_t message_size);

// Loads a calibration from `size` bytes of memory, which are not needed afterwards.
//
// On failure `*out` is null and `message` (of `message_size` bytes; may be null) says what is wrong.
//
// # Safety
// `bytes` has `size` bytes, `out` points to a pointer, `message` is null or has `message_size` bytes.
truearm_status truearm_load_memory(const uint8_t *bytes,
                                   size_t size,
                                   truearm_calibration **out,
                                   char *message,
                                   size_t message_size);

// Frees a calibration; correctors made of it stay usable. Null is no mistake.
//
// # Safety
// `calibration` is null or was loaded and not freed, and nobody uses it.
truearm_status truearm_calibration_free(truearm_calibration *calibration);

// Number of joints; 0 if this is no calibration.
//
// # Safety
// `calibration` is null or was loaded and not freed.
size_t truearm_joint_count(const truearm_calibration *calibration);

// Number of features, such as temperature, that the calibration needs beside the joints; 0 for most.
//
// Wherever features are given, they stand in the order in which calibrating named them, in the units of their columns.
//
// # Safety
// `calibration` is null or was loaded and not freed.
size_t truearm_feature_count(const truearm_calibration *calibration);

// Writes the arm's name, cut to `size` bytes with the zero at its end.
//
// # Safety
// `calibration` is null or was loaded and not freed, `name` has `size` bytes.
truearm_status truearm_robot_name(const truearm_calibration *calibration, char *name, size_t size);

// Options with their defaults: pose, 3 deg, 10 mm, 5 mm, 1 deg, and 1 mm of standard deviation.
truearm_options truearm_default_options(void);

// Makes a corrector for a tool.
//
// `flange_from_tool` are 16 numbers, a 4 x 4 matrix row by row; null means the robot file's own tool. Null as
// `options` means the defaults. On failure `*out` is null and `message` (may be null) says what is wrong.
//
// # Safety
// `calibration` was loaded and not freed, `flange_from_tool` is null or has 16 numbers, `options` is null or points to
// options, `out` points to a pointer, `message` is null or has `message_size` bytes.
truearm_status truearm_corrector_new(const truearm_calibration *calibration,
                                     const double *flange_from_tool,
                                     const truearm_options *options,
                                     truearm_corrector **out,
                                     char *message,
                                     size_t message_size);

// Frees a corrector; its workspaces and streams stay usable. Null is no mistake.
//
// # Safety
// `corrector` is null or was made and not freed, and nobody uses it.
truearm_status truearm_corrector_free(truearm_corrector *corrector);

// Makes a workspace: the memory that one thread needs to use a corrector.
//
// # Safety
// `corrector` was made and not freed, `out` points to a pointer.
truearm_status truearm_workspace_new(const truearm_corrector *corrector, truearm_workspace **out);

// Frees a workspace. Null is no mistake.
//
// # Safety
// `workspace` is null or was made and not freed, and nobody uses it.
truearm_status truearm_workspace_free(truearm_workspace *workspace);

// Stream options with their defaults.
truearm_stream_options truearm_default_stream_options(void);

// Makes a stream: corrections of one robot's set-points, switched on, with nothing applied yet.
//
// Null as `options` means the defaults. On failure `*out` is null and `message` (may be null) says what is wrong.
//
// # Safety
// `corrector` was made and not freed, `options` is null or points to options, `out` points to a pointer, `message` is null
// or has `message_size` bytes.
truearm_status truearm_stream_new(const truearm_corrector *corrector,
                                  const truearm_stream_options *options,
                                  truearm_stream **out,
                                  char *message,
                                  size_t message_size);

// Frees a stream. Null is no mistake.
//
// # Safety
// `stream` is null or was made and not freed, and nobody uses it.
truearm_status truearm_stream_free(truearm_stream *stream);

// Corrects one waypoint: readings of the program in, readings to command out.
//
// TRUEARM_STATUS_OK: `out` is written. TRUEARM_STATUS_REFUSED: `out` is not written, `correction` says why. The arrays may be
// one and the same. `correction` may be null. Where the calibration needs no features, `features` may be null. The standard
// deviation takes part of the time: it is worked out where `correction` is given or `largest_std_m` is finite.
//
// # Safety
// The handles were made and not freed, `readings` has `joints` numbers, `features` `feature_count`, `out` `out_size`.
truearm_status truearm_correct(const truearm_corrector *corrector,
                               truearm_workspace *workspace,
                               const double *readings,
                               size_t joints,
                               const double *features,
                               size_t feature_count,
                               double *out,
                               size_t out_size,
                               truearm_correction *correction);

// Where the calibrated arm puts the tool: `pose` (16 numbers, base_from_tool row by row).
//
// # Safety
// The handles were made and not freed, `readings` has `joints` numbers, `features` `feature_count`, `pose` `pose_size`.
truearm_status truearm_predict_pose(const truearm_corrector *corrector,
                                    truearm_workspace *workspace,
                                    const double *readings,
                                    size_t joints,
                                    const double *features,
                                    size_t feature_count,
                                    double *pose,
                                    size_t pose_size);

// Where the calibrated arm puts the tool's origin: `position` (3 numbers, base frame, m).
//
// # Safety
// The handles were made and not freed, `readings` has `joints` numbers, `features` `feature_count`, `position`
// `position_size`.
truearm_status truearm_predict_position(const truearm_corrector *corrector,
                                        truearm_workspace *workspace,
                                        const double *readings,
                                        size_t joints,
                                        const double *features,
                                        size_t feature_count,
                                        double *position,
                                        size_t position_size);

// Corrects the next set-point of a robot.
//
// `readings` may be null where none came in time, and then `features`, too. `elapsed_s` is the time since the
// call before; above the deadline, below zero or not finite the set-point counts as missed. The first one is
// never late.
//
// TRUEARM_STATUS_OK or TRUEARM_STATUS_HELD: `out` is written and finite; HELD says that this set-point has no
// correction of its own, and that the last one is held or on its ramp down (`state` says why). Where the
// set-point itself is not finite, `out` is the last finite one, corrected. TRUEARM_STATUS_NOT_STARTED: there was
// none yet, and `out` is not written; go on calling. `state` may be null. After any other status nothing has
// become of the set-point.
//
// # Safety
// `stream` was made and not freed, `readings` is null or has `joints` numbers, `features` `feature_count`, `out`
// `out_size`, `state` is null or points to a state.
truearm_status truearm_stream_step(truearm_stream *stream,
                                   const double *readings,
                                   size_t joints,
                                   const double *features,
                                   size_t feature_count,
                                   double elapsed_s,
                                   double *out,
                                   size_t out_size,
                                   truearm_stream_state *state);

// Ramps the correction up (`on` not 0) or down (0) from now on.
//
// # Safety
// `stream` was made and not freed.
truearm_status truearm_stream_switch(truearm_stream *stream, uint32_t on);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* TRUEARM_H */
