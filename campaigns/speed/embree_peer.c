/* Reflects rays from a polygon with Embree, one rtcIntersect1 a ray segment, in one thread, as C is used with it.
 *
 * embree_peer RAYS: reads from RAYS the number of corners, the number of rays (int32), the step off a surface, the
 * corners (x, y), the entry points and the incoming angles (float32); writes the outgoing angles (NaN: lost) over the incoming ones and prints
 * the seconds of the better of three runs and Embree's version.
 */
#include <embree3/rtcore.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define DEPTH 10.0f
#define MOST_BOUNCES 100
#define RUNS 3

static float reflected(RTCScene scene, float step, float x, float theta) {
  struct RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  float px = x, py = 0.0f, vx = -cosf(theta), vy = -sinf(theta);
  for (int bounce = 0; bounce < MOST_BOUNCES; bounce++) {
    struct RTCRayHit found;
    memset(&found, 0, sizeof found);
    found.ray.org_x = px, found.ray.org_y = py;
    found.ray.dir_x = vx, found.ray.dir_y = vy;
    found.ray.tfar = INFINITY, found.ray.mask = -1;
    found.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(scene, &context, &found);
    if (found.hit.geomID == RTC_INVALID_GEOMETRY_ID) return vy > 0.0f ? atan2f(vy, vx) : NAN;
    float nx = found.hit.Ng_x, ny = found.hit.Ng_y;
    float twice = 2.0f * (vx * nx + vy * ny) / (nx * nx + ny * ny), far = found.ray.tfar;
    px += far * vx, py += far * vy;
    vx -= twice * nx, vy -= twice * ny;
    px += step * vx, py += step * vy;
  }
  return NAN;
}

int main(int argc, char **argv) {
  FILE *file = argc == 2 ? fopen(argv[1], "r+b") : NULL;
  int32_t count[2];
  if (!file || fread(count, sizeof *count, 2, file) != 2) return 1;
  int corners = count[0], rays = count[1];
  float step;
  if (fread(&step, sizeof step, 1, file) != 1) return 1;
  float *corner = malloc(2 * corners * sizeof *corner), *x = malloc(rays * sizeof *x);
  float *theta = malloc(rays * sizeof *theta), *out = malloc(rays * sizeof *out);
  if (fread(corner, sizeof *corner, 2 * corners, file) != (size_t)(2 * corners)) return 1;
  if (fread(x, sizeof *x, rays, file) != (size_t)rays) return 1;
  long place = ftell(file);
  if (fread(theta, sizeof *theta, rays, file) != (size_t)rays) return 1;

  RTCDevice device = rtcNewDevice("threads=1");
  RTCScene scene = rtcNewScene(device);
  RTCGeometry wall = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  float *vertex = rtcSetNewGeometryBuffer(wall, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, 2 * corners);
  uint32_t *index = rtcSetNewGeometryBuffer(wall, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, 2 * (corners - 1));
  for (int k = 0; k < 2 * corners; k++) {
    vertex[3 * k] = corner[2 * (k / 2)], vertex[3 * k + 1] = corner[2 * (k / 2) + 1];
    vertex[3 * k + 2] = k % 2 ? DEPTH : -DEPTH;
  }
  for (int k = 0; k < 2 * (corners - 1); k++)
    for (int j = 0; j < 3; j++) index[3 * k + j] = k + j;
  rtcCommitGeometry(wall);
  rtcAttachGeometry(scene, wall);
  rtcCommitScene(scene);

  double best = INFINITY;
  for (int run = 0; run < RUNS; run++) {
    struct timespec start, end;
    clock_gettime(CLOCK_MONOTONIC, &start);
    for (int i = 0; i < rays; i++) out[i] = reflected(scene, step, x[i], theta[i]);
    clock_gettime(CLOCK_MONOTONIC, &end);
    double seconds = (end.tv_sec - start.tv_sec) + 1e-9 * (end.tv_nsec - start.tv_nsec);
    if (seconds < best) best = seconds;
  }
  fseek(file, place, SEEK_SET);
  fwrite(out, sizeof *out, rays, file);
  fclose(file);
  printf("%.9g %s\n", best, RTC_VERSION_STRING);
  return 0;
}
