/* Presses an object of a dataset through the haptic loop, with a device that is only moved here, and looks torques up in its field.
 *
 *     press DATASET Q1 [Q2 ...]
 */
#include <haptize.h>

#include <stdio.h>
#include <stdlib.h>

static int fail(const char *what, hz_code code, const char *message)
{
    fprintf(stderr, "%s failed with code %d: %s\n", what, (int)code, message);
    return EXIT_FAILURE;
}

int main(int count, char **arguments)
{
    char message[1024] = "";
    hz_field *field = NULL;
    hz_loop *haptics = NULL;
    hz_sample sample = {0};
    hz_tick tick = {0};
    double q[HZ_MAX_JOINTS] = {0}, y[HZ_MAX_JOINTS], tau[HZ_MAX_JOINTS] = {0}, least[HZ_MAX_JOINTS], greatest[HZ_MAX_JOINTS];
    uint32_t joints, joint;
    hz_code code;
    int k;

    if (count < 2) {
        fprintf(stderr, "usage: press DATASET Q1 [Q2 ...]\n");
        return EXIT_FAILURE;
    }
    if (hz_abi() != HZ_ABI) {
        fprintf(stderr, "the library has interface %u, this program was compiled with %u\n", (unsigned)hz_abi(), HZ_ABI);
        return EXIT_FAILURE;
    }
    code = hz_field_open(arguments[1], &field, message, sizeof message);
    if (code != HZ_OK)
        return fail("hz_field_open", code, message);
    joints = hz_field_joints(field);
    if ((uint32_t)count != joints + 2) {
        fprintf(stderr, "the dataset has %u joints\n", (unsigned)joints);
        hz_field_close(field);
        return EXIT_FAILURE;
    }
    hz_field_bounds(field, least, greatest);
    sample.size = sizeof sample;
    tick.size = sizeof tick;
    for (joint = 0; joint < joints; joint++)
        q[joint] = strtod(arguments[joint + 2], NULL);

    /* A look-up. */
    code = hz_field_torque(field, q, tau);
    printf("torque %d", (int)code);
    for (joint = 0; joint < joints; joint++)
        printf(" %.17g", tau[joint]);
    code = hz_field_sample(field, q, &sample);
    printf("\nsample %d %u %.17g\n", (int)code, (unsigned)sample.status, sample.energy);
    hz_field_close(field);

    /* Half a second of the loop, from the grid's corner to q. */
    code = hz_loop_open(arguments[1], NULL, &haptics, message, sizeof message);
    if (code != HZ_OK)
        return fail("hz_loop_open", code, message);
    if (message[0] != '\0')
        fprintf(stderr, "%s\n", message);
    code = hz_loop_start(haptics, least);
    for (k = 0; k < 500 && code == HZ_OK; k++) {
        for (joint = 0; joint < joints; joint++)
            y[joint] = least[joint] + (q[joint] - least[joint]) * k / 499.0;
        code = hz_loop_tick(haptics, y, 0.0, hz_loop_period(haptics), tau, &tick);
    }
    hz_loop_fault(haptics, message, sizeof message);
    printf("loop %d %u", (int)code, (unsigned)tick.contact);
    for (joint = 0; joint < joints; joint++)
        printf(" %.17g", tau[joint]);
    printf("\n%s", message);
    hz_loop_close(haptics);
    return code == HZ_OK ? EXIT_SUCCESS : EXIT_FAILURE;
}
