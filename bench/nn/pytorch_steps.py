# SPDX-License-Identifier: Apache-2.0
"""The training steps of training_steps.h in PyTorch, behind the protocol of step_server.cc.

    python3 pytorch_steps.py NETWORK THREADS

The caller sets OMP_NUM_THREADS, OPENBLAS_NUM_THREADS and the binding before the start:
torch.set_num_threads alone does not limit OpenBLAS.
"""

import json
import resource
import sys
import time

import torch
from torch import nn


def dense(widths):
    layers = []
    for i in range(1, len(widths)):
        layers.append(nn.Linear(widths[i - 1], widths[i]))
        if i + 1 < len(widths):
            layers += [nn.BatchNorm1d(widths[i]), nn.ReLU(inplace=True)]
    return layers


class Reconstruction(nn.Module):
    def __init__(self):
        super().__init__()
        channels = [4, 64, 128, 256]
        convs = []
        for i in range(3):
            convs += [nn.Conv2d(channels[i], channels[i + 1], 5, stride=2, padding=2),
                      nn.BatchNorm2d(channels[i + 1]), nn.ReLU(inplace=True)]
        self.encoder = nn.Sequential(*convs, nn.Flatten(), *dense([16384, 1024, 1024, 1024]))
        self.shape = nn.Sequential(*dense([1024, 1024, 2048, 642 * 3]))
        self.color = nn.Sequential(*dense([1024, 1024, 2048, 642 * 3]))
        self.image = torch.rand(64, 4, 64, 64)

    def loss(self):
        code = self.encoder(self.image)
        return self.shape(code).square().mean() + self.color(code).square().mean()


class Judge(nn.Module):
    def __init__(self, batch=32, base=64, channels=3, size=(64, 64), border="zeros"):
        super().__init__()
        c = [channels] + [base << i for i in range(4)]
        layers = []
        for i in range(4):
            layers += [nn.Conv2d(c[i], c[i + 1], 4, stride=2, padding=1, padding_mode=border),
                       nn.LeakyReLU(0.2)]
        self.net = nn.Sequential(*layers, nn.Conv2d(c[-1], 1, 3, padding=1, padding_mode=border))
        self.real, self.fake = (torch.rand(batch, channels, *size) for _ in range(2))

    def penalty(self, x):
        x = x.detach().requires_grad_()
        scores = self.net(x).reshape(len(x), -1).mean(1).sum()
        d_x, = torch.autograd.grad(scores, x, create_graph=True)
        norm = (d_x.reshape(len(x), -1).square().sum(1) + 1e-12).sqrt()
        return (norm - 1).square().mean()

    def loss(self):
        return (self.net(self.fake).mean() - self.net(self.real).mean() +
                10 * self.penalty(0.5 * self.real + 0.5 * self.fake))


class Forger(nn.Module):
    def __init__(self):
        super().__init__()
        self.pictures = Judge(16, 24, channels=18)
        self.maps = Judge(16, 24, size=(128, 64), border="replicate")
        self.fc = nn.Linear(64, 128 * 8 * 4)
        layers = []
        for level in range(4):
            c, last = 128 >> level, level == 3
            layers += [nn.Upsample(scale_factor=2),
                       nn.Conv2d(c, 3 if last else c // 2, 3, padding=1, bias=last)]
            layers += [nn.Sigmoid()] if last else [nn.BatchNorm2d(c // 2), nn.LeakyReLU(0.2)]
        self.up = nn.Sequential(*layers)
        self.noise = torch.rand(16, 64)

    def loss(self):
        made = self.up(self.fc(self.noise).reshape(16, 128, 8, 4))
        return self.pictures.loss() + self.maps.loss() - self.maps.net(made).mean()


NETWORKS = {"reconstruction": Reconstruction, "critic": Judge,
            "adversarial": lambda: Judge(batch=24, base=32), "gan": Forger}


def main():
    network, threads = NETWORKS[sys.argv[1]], int(sys.argv[2])
    torch.set_num_threads(threads)
    torch.manual_seed(1)
    model = network()
    optimizer = torch.optim.Adam(model.parameters(), lr=1e-4)
    for _ in sys.stdin:
        wall, cpu = time.perf_counter(), time.process_time()
        optimizer.zero_grad(set_to_none=True)
        loss = model.loss()
        loss.backward()
        optimizer.step()
        cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024e-6
        print(json.dumps({"cpu_ms": cpu * 1e3, "wall_ms": wall * 1e3, "loss": loss.item(),
                          "rss_mb": peak}), flush=True)


if __name__ == "__main__":
    main()
