// Embree's side of the ray benchmark: reads a scene and sets of rays, then answers each line "k" on standard input
// with "cpu_seconds hits" for set k. Single-ray API, ROBUST, one thread.

#include <embree3/rtcore.h>

#include <cstdint>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <limits>
#include <vector>

struct Ray { float o[3], d[3], t_max; };
struct Set { uint32_t any; std::vector<Ray> rays; };

static bool read(FILE* f, void* to, size_t size, size_t count) { return fread(to, size, count, f) == count; }

static double cpu_seconds() {
    timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

int main(int argc, char** argv) {
    FILE* f = argc == 2 ? fopen(argv[1], "rb") : nullptr;
    uint32_t n[3];  // corners, triangles, sets
    if (!f || !read(f, n, 4, 3)) return fprintf(stderr, "usage: embree_rays FILE\n"), 1;

    RTCDevice device = rtcNewDevice("threads=1");
    RTCScene scene = rtcNewScene(device);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
    RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    void* corners = rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, n[0]);
    void* triangles = rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, n[1]);
    if (!read(f, corners, 12, n[0]) || !read(f, triangles, 12, n[1])) return 1;
    rtcCommitGeometry(mesh);
    rtcAttachGeometry(scene, mesh);
    rtcCommitScene(scene);

    std::vector<Set> sets(n[2]);
    for (Set& set : sets) {
        uint32_t head[2];  // any hit?, rays
        if (!read(f, head, 4, 2)) return 1;
        set.any = head[0];
        set.rays.resize(head[1]);
        if (!read(f, set.rays.data(), sizeof(Ray), head[1])) return 1;
    }
    fclose(f);
    puts("ready");
    fflush(stdout);

    unsigned k;
    while (scanf("%u", &k) == 1 && k < sets.size()) {
        const Set& set = sets[k];
        uint64_t hits = 0;
        double sum = 0;
        const double start = cpu_seconds();
        for (const Ray& r : set.rays) {
            RTCIntersectContext context;
            rtcInitIntersectContext(&context);
            RTCRayHit q;
            q.ray.org_x = r.o[0]; q.ray.org_y = r.o[1]; q.ray.org_z = r.o[2];
            q.ray.dir_x = r.d[0]; q.ray.dir_y = r.d[1]; q.ray.dir_z = r.d[2];
            q.ray.tnear = 0; q.ray.tfar = r.t_max;
            q.ray.time = 0; q.ray.mask = ~0u; q.ray.flags = 0;
            if (set.any) {
                rtcOccluded1(scene, &context, &q.ray);
                hits += q.ray.tfar < 0;
            } else {
                q.hit.geomID = RTC_INVALID_GEOMETRY_ID;
                q.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
                rtcIntersect1(scene, &context, &q);
                const bool hit = q.hit.geomID != RTC_INVALID_GEOMETRY_ID;
                hits += hit;
                sum += hit ? q.ray.tfar : 0;
            }
        }
        const double spent = cpu_seconds() - start;
        printf("%.9f %llu %.9g\n", spent, (unsigned long long)hits, sum);
        fflush(stdout);
    }
}
