// A subscriber on Zenoh in C, with zenoh-pico 1.9 or newer and msgpack-c: the poses of a chassis.
// apt install libmsgpack-dev, and zenoh-pico from its sources (CMake, no dependencies). Then
// cc examples/07_subscriber.c $(pkg-config --cflags --libs zenohpico msgpack) -DZENOH_LINUX -o subscriber
// ./subscriber tcp/127.0.0.1:7447

#include <msgpack.h>
#include <stdio.h>
#include <string.h>
#include <zenoh-pico.h>

// The value of a key of a map; an error message and the end of the program if it is not there.
static const msgpack_object *field(const msgpack_object *map, const char *key) {
    for (uint32_t i = 0; map->type == MSGPACK_OBJECT_MAP && i < map->via.map.size; i++) {
        const msgpack_object_kv *pair = &map->via.map.ptr[i];
        if (pair->key.type == MSGPACK_OBJECT_STR && pair->key.via.str.size == strlen(key) &&
            memcmp(pair->key.via.str.ptr, key, strlen(key)) == 0)
            return &pair->val;
    }
    fprintf(stderr, "the message has no %s\n", key);
    exit(1);
}

static void print_pose(const z_loaned_sample_t *sample) {
    z_owned_slice_t payload;
    z_bytes_to_slice(z_sample_payload(sample), &payload);
    msgpack_unpacked message;
    msgpack_unpacked_init(&message);
    const char *data = (const char *)z_slice_data(z_loan(payload));
    if (msgpack_unpack_next(&message, data, z_slice_len(z_loan(payload)), NULL) != MSGPACK_UNPACK_SUCCESS) {
        fprintf(stderr, "the payload is not MessagePack\n");
        exit(1);
    }
    const msgpack_object *pose = field(&message.data, "pose");
    printf("%.2f s  x %.3f m  y %.3f m  yaw %.3f rad\n", field(&message.data, "stamp")->via.u64 / 1e9,
           field(pose, "x")->via.f64, field(pose, "y")->via.f64, field(pose, "yaw")->via.f64);
    msgpack_unpacked_destroy(&message);
    z_drop(z_move(payload));
}

int main(int count, char **arguments) {
    if (count != 2) {
        fprintf(stderr, "usage: %s tcp/127.0.0.1:7447\n", arguments[0]);
        return 2;
    }
    z_owned_config_t config;
    z_config_default(&config);
    zp_config_insert(z_loan_mut(config), Z_CONFIG_MODE_KEY, "client");
    zp_config_insert(z_loan_mut(config), Z_CONFIG_CONNECT_KEY, arguments[1]);
    z_owned_session_t session;
    if (z_open(&session, z_move(config), NULL) < 0) {
        fprintf(stderr, "no router answers at %s\n", arguments[1]);
        return 1;
    }
    z_view_keyexpr_t key;
    z_view_keyexpr_from_str(&key, "rackhand/amr1/chassis/pose");
    z_owned_closure_sample_t to_queue;
    z_owned_fifo_handler_sample_t queue;
    z_fifo_channel_sample_new(&to_queue, &queue, 16);
    z_owned_subscriber_t subscriber;
    if (z_declare_subscriber(z_loan(session), &subscriber, z_loan(key), z_move(to_queue), NULL) < 0) return 1;
    z_owned_sample_t sample;
    for (int i = 0; i < 5 && z_recv(z_loan(queue), &sample) == Z_OK; i++) {
        print_pose(z_loan(sample));
        z_drop(z_move(sample));
    }
    z_drop(z_move(subscriber));
    z_drop(z_move(queue));
    z_drop(z_move(session));
    return 0;
}
