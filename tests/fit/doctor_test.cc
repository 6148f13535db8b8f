// SPDX-License-Identifier: Apache-2.0
// The gradient doctor names the cause: each scene here has one.
#include "fit/doctor.h"

#include <gtest/gtest.h>

#include "scene/shapes.h"
#include "support/expect.h"

namespace tilegrad::train::doctor_test {

constexpr int kSize = 32;
constexpr int kView = 0;

// A red sphere of radius 0.4 in the middle, and images of it of radius 0.5.
struct Patient {
  Workers workers{1};
  FitScene scene = SceneOfMesh(Icosphere(2, 0.4f)).value();
  FitterOptions options;
  TargetImages targets;
  RenderOptions render;

  Patient() {
    scene.cameras = {OrbitCamera({40, kSize, kSize}, 90, 0, 3)};
    render.width = render.height = kSize;
    render.delta = 1e-3;
    Target(SceneOfMesh(Icosphere(2, 0.5f)).value());
  }
  FitStep Step() const {
    FitStep step;
    step.views = {&kView, 1};
    step.targets = &targets;
    step.job.options = render;
    return step;
  }
  // What the images show: in red.
  void Target(FitScene truth) {
    truth.cameras = {OrbitCamera({40, kSize, kSize}, 90, 0, 3)};
    for (std::size_t i = 0; i < truth.colors.size(); ++i) truth.colors[i] = i % 3 == 0 ? 1 : 0;
    FitRenderer renderer(workers);
    FitRenderer::Job job = Step().job;
    job.views = {&kView, 1};
    ASSERT_TRUE(renderer.Render(truth, job).ok());
    const std::span<const float> color = renderer.images().color;
    targets = {kSize, kSize, {color.begin(), color.end()}, {}};
    for (const std::int32_t face : renderer.images().face_ids) {
      targets.alpha.push_back(face >= 0 ? 1.0f : 0.0f);
    }
  }
  void MoveMesh(float x, float z) {
    for (std::size_t i = 0; i < scene.positions.size(); i += 3) {
      scene.positions[i] += x;
      scene.positions[i + 2] += z;
    }
  }
  Finding Ask(Parameter parameter) {
    options.parameters[parameter] = true;
    const auto findings = Diagnose(scene, options, Step(), workers);
    EXPECT_TRUE(findings.ok()) << findings.status().message();
    if (!findings.ok() || findings->size() != 1) return {};
    return findings->front();
  }
};

void ExpectBlocked(const Finding& finding, const std::string& word) {
  EXPECT_TRUE(finding.blocked) << finding.sentence;
  ExpectIn(finding.sentence, word);
}

TEST(Doctor, HealthyParametersHaveNoComplaint) {
  for (const Parameter p : {Parameter::kPositions, Parameter::kColors, Parameter::kCamera}) {
    Patient patient;
    const Finding finding = patient.Ask(p);
    EXPECT_FALSE(finding.blocked) << NameOf(p) << ": " << finding.sentence;
    EXPECT_GT(finding.share, 0.1) << NameOf(p);
  }
}

TEST(Doctor, PlanThatExcludesIt) {
  ExpectBlocked(Patient().Ask(Parameter::kTexture), "no texture");
  ExpectBlocked(Patient().Ask(Parameter::kSh), "spherical harmonics");
  ExpectBlocked(Patient().Ask(Parameter::kLight), "direction");
}

TEST(Doctor, BehindTheCamera) {
  Patient patient;
  patient.MoveMesh(0, 8);  // the camera is at z = 3 and looks along -z
  ExpectBlocked(patient.Ask(Parameter::kColors), "behind the camera");
}

TEST(Doctor, OutsideOfTheImage) {
  Patient patient;
  patient.MoveMesh(30, 0);
  ExpectBlocked(patient.Ask(Parameter::kColors), "outside of the image");
}

TEST(Doctor, CamerasInsideTheMesh) {
  Patient patient;
  patient.options.loss.color_weight = 0;
  for (float& x : patient.scene.positions) x *= 8;
  ExpectBlocked(patient.Ask(Parameter::kPositions), "inside it");
}

TEST(Doctor, AllLossFartherThanDeltaReaches) {
  Patient patient;
  patient.options.loss.color_weight = 0;
  patient.MoveMesh(0.85f, 0);  // beside where the image shows it
  patient.render.delta = 1e-6;
  const Finding finding = patient.Ask(Parameter::kPositions);
  ExpectIn(finding.sentence, "out of reach of delta");
}

TEST(Doctor, OnlyTheSilhouetteCounts) {
  Patient patient;
  patient.options.loss.color_weight = 0;
  ExpectBlocked(patient.Ask(Parameter::kColors), "only the silhouette");
}

TEST(Doctor, DrawnWhereTheMaskHasNothing) {
  Patient patient;
  patient.targets.alpha.assign(patient.targets.alpha.size(), 0.0f);
  ExpectBlocked(patient.Ask(Parameter::kColors), "only pixels outside the masks");
}

TEST(Doctor, FacesAwayFromTheLight) {
  Patient patient;
  patient.scene.shading.lighting = Lighting::kLambert;
  patient.scene.light = {0, 0, -1};
  ExpectBlocked(patient.Ask(Parameter::kLight), "faces away from the light");
}

TEST(Doctor, ReachIsWhereAMillionthIsLeft) {
  const double pixels = ReachInPixels(1e-3, 256), ndc = pixels * 2 / 256;
  EXPECT_NEAR(std::exp(-ndc * ndc / 1e-3), 1e-6, 1e-12);
}

}  // namespace tilegrad::train::doctor_test
