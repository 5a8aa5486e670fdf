/* The C interface of haptize: torques looked up in a dataset or solved live, the passive haptic loop,
 * direct equilibria.
 *
 * - Handles are opaque. Each is made by a function ..._open and closed by ..._close. None is shared with another library.
 * - Results are hz_code: negative where the call failed. Nothing is thrown, no panic leaves the library.
 * - Text is UTF-8. A message is written into the caller's buffer, cut where it does not fit, always ended by a zero.
 * - A structure begins with its own size, to be set before the call: later versions of the library only make structures longer.
 * - All quantities are SI: m, rad, N, N m, kg, s, J. Joint vectors have one entry per joint of the arm.
 * - Real-time safe, allocating nothing and waiting for nothing: hz_field_torque, hz_field_sample, hz_field_bounds, hz_live_sample,
 *   hz_loop_start, hz_loop_tick.
 *   Torques of hz_loop_tick are limited in size and rate; whatever is wrong with a device's position, they go to zero.
 *
 * This file is made by cbindgen from the sources in capi/src. Do not edit it.
 */

#ifndef HAPTIZE_H
#define HAPTIZE_H

#include <stddef.h>
#include <stdint.h>

// Number of this interface. A program that was compiled with another one must not be run with this library.
#define HZ_ABI 1

// Most joints that an arm may have here.
#define HZ_MAX_JOINTS 6

// How a call ended. Below zero it failed, and nothing but zeros was written to its results.
enum hz_code
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Everything is as it should be.
  HZ_OK = 0,
  // The configuration is outside the grid, or beside a grid point that was not computed.
  HZ_OUTSIDE = 1,
  // Beside a grid point that did not converge: the torque is not to be trusted.
  HZ_UNCONVERGED = 2,
  // The loop has let go: the torque is being brought to zero, or has been. hz_loop_fault tells why.
  HZ_LET_GO = 3,
  // An argument is NULL, not a finite number, of a wrong size, or out of its range.
  HZ_ARGUMENT = -1,
  // A file cannot be read.
  HZ_FILE = -2,
  // A file is not a dataset, of another version, or damaged.
  HZ_FORMAT = -3,
  // A scene or its object is not valid; the message names file and line.
  HZ_SCENE = -4,
  // A defect of the library; please report it.
  HZ_DEFECT = -99,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum hz_code hz_code;
#else
typedef int32_t hz_code;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// The torque field of a dataset. Any number of threads may look it up at once.
typedef struct hz_field hz_field;

// The contact of a scene, before the surface at rest. One thread at a time may use it.
typedef struct hz_live hz_live;

// A haptic loop: the virtual proxy, its coupling to the device, the torque field, and the watchdog. One thread at a
// time may use it.
typedef struct hz_loop hz_loop;

// The object and the arm of a scene, ready to be solved at any configuration. Any number of threads may use it at
// once.
typedef struct hz_solver hz_solver;

// A look-up in full. Set `size` before the call.
typedef struct hz_sample {
  // sizeof(hz_sample).
  size_t size;
  // Torque on the arm, one entry per joint, then zeros (N m; N at prismatic joints).
  double torque[HZ_MAX_JOINTS];
  // Energy that the object stores (J); zero where the dataset does not tell it.
  double energy;
  // Share of the grid points around that are in contact, 0 to 1.
  double index;
  // 0 free, 1 in contact, 2 not converged, 4 outside the grid or not computed.
  uint32_t status;
  // Nodes of the object in contact; zero where nothing touches.
  uint32_t contact_nodes;
} hz_sample;

// Gains in the place of the scene's. Initialise all of it with zeros, set `size`, and one entry per joint of what is
// to change: a list of zeros leaves the scene's.
typedef struct hz_gains {
  // sizeof(hz_gains).
  size_t size;
  // Stiffness of the virtual coupling at each joint (N m/rad; N/m).
  double coupling_stiffness[HZ_MAX_JOINTS];
  // Damping of the virtual coupling at each joint (N m s/rad; N s/m).
  double coupling_damping[HZ_MAX_JOINTS];
  // Greatest torque of each joint, in size (N m; N).
  double torque_limit[HZ_MAX_JOINTS];
} hz_gains;

// The report of a tick beside its torque. Set `size` before the call.
typedef struct hz_tick {
  // sizeof(hz_tick).
  size_t size;
  // Position of the virtual proxy, one entry per joint, then zeros (rad; m).
  double proxy[HZ_MAX_JOINTS];
  // Contact torque on the proxy (N m; N).
  double contact_torque[HZ_MAX_JOINTS];
  // Energy that the object stores (J); zero where the dataset does not tell it.
  double energy;
  // 1 in contact, else 0.
  uint32_t contact;
  // Remarks, as bits: 1 outside the grid, 2 beside a grid point that was not computed, 4 beside one that did not
  // converge, 8 held by the boundary layer, 16 a joint at its limit, 32 torque cut in size, 64 torque cut in rate,
  // 128 held at the border of the haptized range.
  uint32_t flags;
} hz_tick;

// An equilibrium. Set `size` before the call.
typedef struct hz_equilibrium {
  // sizeof(hz_equilibrium).
  size_t size;
  // Torque on the arm, one entry per joint, then zeros (N m; N at prismatic joints).
  double torque[HZ_MAX_JOINTS];
  // Energy that object and contact store (J).
  double energy;
  // Smallest signed distance of the arm's nodes to the surface at rest (m).
  double gap;
  // Relative imbalance of forces (1).
  double residual;
  // 0 free, 1 in contact, 2 not converged, 3 more contacts than there is room for.
  uint32_t status;
  // Iterations of the contact solver.
  uint32_t iterations;
  // Number of nodes of the object that are pushed.
  size_t forces;
} hz_equilibrium;

// The contact force on a node of the object.
typedef struct hz_force {
  // Number of the node.
  size_t node;
  // Force on it (N).
  double force[3];
} hz_force;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Returns HZ_ABI of the library, to be compared with that of the header.
uint32_t hz_abi(void);

// Returns the library's version, such as "0.1.0". The text is never freed.
const char *hz_version(void);

// Opens the dataset file at `path` (UTF-8) and makes the field of it in memory as its scene has it felt; without a
// scene it is interpolated linearly. The file is checked in full, and not needed afterwards.
//
// On success `*field` is to be closed with hz_field_close; on failure it is NULL and `message`, `message_size` bytes
// that may be NULL, says why. Returns HZ_OK, HZ_ARGUMENT, HZ_FILE, HZ_FORMAT or HZ_SCENE.
//
// Pointers:
// All are NULL or as described.
hz_code hz_field_open(const char *path, struct hz_field **field, char *message, size_t message_size);

// Closes a field; NULL is left alone. No other call may be using it.
//
// Pointers:
// `field` is NULL or one that was opened and not yet closed.
void hz_field_close(struct hz_field *field);

// Returns the number of joints, 1 to HZ_MAX_JOINTS; 0 for NULL.
//
// Pointers:
// `field` is NULL or open.
uint32_t hz_field_joints(const struct hz_field *field);

// Tells the grid's ends, one entry per joint each (rad; m at prismatic joints). Real-time safe.
//
// Pointers:
// `field` is NULL or open; `least` and `greatest` are NULL or have one entry per joint.
hz_code hz_field_bounds(const struct hz_field *field, double *least, double *greatest);

// Looks up the torque `tau` (N m; N at prismatic joints) at the configuration `q` (rad; m), one entry per joint each.
// Real-time safe: it allocates, locks and prints nothing, waits for nothing, and takes the same time wherever `q` is.
// Any number of threads may call it.
//
// Returns HZ_OK, HZ_OUTSIDE or HZ_UNCONVERGED; HZ_ARGUMENT for NULL or a `q` that is not finite, with zeros for a
// torque.
//
// Pointers:
// `field` is NULL or open; `q` and `tau` are NULL or have one entry per joint.
hz_code hz_field_torque(const struct hz_field *field, const double *q, double *tau);

// Looks up all that the field knows of the configuration `q` (rad; m). Real-time safe as hz_field_torque, with the
// same codes.
//
// Pointers:
// `field` is NULL or open; `q` is NULL or has one entry per joint; `sample` is NULL or tells its size.
hz_code hz_field_sample(const struct hz_field *field, const double *q, struct hz_sample *sample);

// Looks up `count` torques on all cores: row k of `tau` at row k of `q`, rows of one entry per joint. `status`, which
// may be NULL, is told the status of each, as hz_sample has it. `tau` may be `q`. Not for the real-time thread.
//
// Returns HZ_OK; HZ_ARGUMENT for NULL or a `q` that is not finite, with zeros for all torques.
//
// Pointers:
// `field` is NULL or open; `q` and `tau` are NULL or have `count` rows, `status` is NULL or has `count` entries, and
// overlaps neither.
hz_code hz_field_torques(const struct hz_field *field, size_t count, const double *q, double *tau, uint8_t *status);

// Opens the dataset file at `path` (UTF-8) and makes the haptic loop of its scene, with `gains` in the place of the
// scene's where that is not NULL. A path that ends in .toml is that of a scene: nothing of it is baked, and contact is
// solved in every tick, before the surface at rest. The file is not needed afterwards.
//
// On success `*loop` is to be closed with hz_loop_close, and `message`, `message_size` bytes that may be NULL, names
// the gains that are beyond their passivity bound, each with a remedy, and says where contact is solved otherwise than
// the scene has it; it is empty where there is nothing to say. On failure
// `*loop` is NULL and `message` says why. Returns HZ_OK, HZ_ARGUMENT, HZ_FILE, HZ_FORMAT or HZ_SCENE.
//
// Pointers:
// All are NULL or as described; `gains` tells its size.
hz_code hz_loop_open(const char *path, const struct hz_gains *gains, struct hz_loop **loop, char *message, size_t message_size);

// Closes a loop; NULL is left alone. No other call may be using it.
//
// Pointers:
// `loop` is NULL or one that was opened and not yet closed.
void hz_loop_close(struct hz_loop *loop);

// Returns the number of joints, 1 to HZ_MAX_JOINTS; 0 for NULL.
//
// Pointers:
// `loop` is NULL or open.
uint32_t hz_loop_joints(const struct hz_loop *loop);

// Returns the time between two ticks for which the gains are meant (s); 0 for NULL.
//
// Pointers:
// `loop` is NULL or open.
double hz_loop_period(const struct hz_loop *loop);

// Begins at the device's position `y`, one entry per joint (rad; m): before the first tick, and to end a fault. The
// torque goes on from what the device is under, so that there is no jump. Real-time safe: it allocates, locks and
// prints nothing, and waits for nothing.
//
// Returns HZ_OK, or HZ_ARGUMENT for NULL or a position that is none; a fault then stays.
//
// Pointers:
// `loop` is NULL or open; `y` is NULL or has one entry per joint.
hz_code hz_loop_start(struct hz_loop *loop, const double *y);

// Does one tick: `tau` is what the device is to exert until the next one (N m; N), for its position `y` (rad; m), one
// entry per joint each. `age` is the time since that was measured (s), `dt` the time since the tick before (s).
// `tick`, which may be NULL, is told the rest. Real-time safe: it allocates, locks and prints nothing, and waits for
// nothing.
//
// Returns HZ_OK, or HZ_LET_GO once something was wrong with a position, its age, the time between ticks or the energy
// at the device; the torque then goes to zero at the rate to which the scene limits it, and stays there until
// hz_loop_start. HZ_ARGUMENT, with zeros for a torque, for NULL or before hz_loop_start.
//
// Pointers:
// `loop` is NULL or open; `y` and `tau` are NULL or have one entry per joint; `tick` is NULL or tells its size.
hz_code hz_loop_tick(struct hz_loop *loop, const double *y, double age, double dt, double *tau, struct hz_tick *tick);

// Tells in `message`, `message_size` bytes, why the loop has let go and what to do about it; an empty text where it
// has not.
//
// Returns HZ_OK, HZ_LET_GO, or HZ_ARGUMENT for NULL.
//
// Pointers:
// `loop` is NULL or open; `message` is NULL or has `message_size` bytes.
hz_code hz_loop_fault(const struct hz_loop *loop, char *message, size_t message_size);

// Reads the scene file at `path` (UTF-8) and prepares its object and arm. That takes up to some seconds.
//
// On success `*live` is to be closed with hz_live_close, and `message`, `message_size` bytes that may be NULL, says
// where contact is solved otherwise than the scene has it; on failure `*live` is NULL and `message` says why, with file
// and line. Returns HZ_OK, HZ_ARGUMENT, HZ_FILE or HZ_SCENE.
//
// Pointers:
// All are NULL or as described.
hz_code hz_live_open(const char *path, struct hz_live **live, char *message, size_t message_size);

// Closes it; NULL is left alone. No other call may be using it.
//
// Pointers:
// `live` is NULL or one that was opened and not yet closed.
void hz_live_close(struct hz_live *live);

// Returns the number of joints, 1 to HZ_MAX_JOINTS; 0 for NULL.
//
// Pointers:
// `live` is NULL or open.
uint32_t hz_live_joints(const struct hz_live *live);

// Solves contact at the configuration `q`, one entry per joint (rad; m): fast along a way, where `q` is near the one
// before. Real-time safe: it allocates, locks and prints nothing, and waits for nothing; its work is bounded.
//
// Returns HZ_OK; HZ_UNCONVERGED where contact is larger than what is solved, with what was solved last; HZ_ARGUMENT,
// with zeros, for NULL or a `q` that is not finite.
//
// Pointers:
// `live` is NULL or open; `q` is NULL or has one entry per joint; `sample` is NULL or tells its size.
hz_code hz_live_sample(struct hz_live *live, const double *q, struct hz_sample *sample);

// Reads the scene file at `path` (UTF-8) and prepares its object and arm. That takes up to some seconds.
//
// On success `*solver` is to be closed with hz_solver_close; on failure it is NULL and `message`, `message_size` bytes
// that may be NULL, says why, with file and line. Returns HZ_OK, HZ_ARGUMENT, HZ_FILE or HZ_SCENE.
//
// Pointers:
// All are NULL or as described.
hz_code hz_solver_open(const char *path, struct hz_solver **solver, char *message, size_t message_size);

// Closes a solver; NULL is left alone. No other call may be using it.
//
// Pointers:
// `solver` is NULL or one that was opened and not yet closed.
void hz_solver_close(struct hz_solver *solver);

// Returns the number of joints, 1 to HZ_MAX_JOINTS; 0 for NULL.
//
// Pointers:
// `solver` is NULL or open.
uint32_t hz_solver_joints(const struct hz_solver *solver);

// Solves the equilibrium at the configuration `q`, one entry per joint (rad; m), from the object at rest. `forces`,
// which may be NULL, is told as many contact forces as it has room for, `room`; `equilibrium` tells how many there
// are. Takes some tenths of a millisecond and more, and allocates: not for the real-time thread.
//
// Returns HZ_OK, HZ_UNCONVERGED, or HZ_ARGUMENT for NULL or a `q` that is not finite.
//
// Pointers:
// `solver` is NULL or open; `q` is NULL or has one entry per joint; `equilibrium` is NULL or tells its size; `forces`
// is NULL or has `room` entries.
hz_code hz_solver_solve(const struct hz_solver *solver,
                        const double *q,
                        struct hz_equilibrium *equilibrium,
                        struct hz_force *forces,
                        size_t room);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* HAPTIZE_H */
