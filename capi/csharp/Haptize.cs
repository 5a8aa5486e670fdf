// The C interface of haptize in C#, for Unity and .NET (C# 7.0, .NET Standard 2.0 and newer).
//
// - The library is found as `haptize`: libhaptize.so, libhaptize.dylib; on Windows name haptize_capi.dll haptize.dll.
// - Open throws HaptizeException with the library's message. So does any other call whose code is negative.
// - Arrays have one entry per joint or more. They are pinned, never copied: calls that are real-time safe in C allocate
//   nothing here.
// - All quantities are SI: m, rad, N, N m, kg, s, J. haptize.h says more of each function.

using System;
using System.Runtime.InteropServices;
using System.Text;

namespace Haptize
{
    /// <summary>How a call ended. What is negative is thrown as a HaptizeException.</summary>
    public enum Code
    {
        Ok = 0,
        /// <summary>Outside the grid, or beside a grid point that was not computed.</summary>
        Outside = 1,
        /// <summary>Beside a grid point that did not converge: the torque is not to be trusted.</summary>
        Unconverged = 2,
        /// <summary>The loop brings its torque to zero; Loop.Fault says why.</summary>
        LetGo = 3,
        Argument = -1,
        File = -2,
        Format = -3,
        Scene = -4,
        Defect = -99,
    }

    /// <summary>A call failed. The message is the library's.</summary>
    public sealed class HaptizeException : Exception
    {
        public Code Code { get; }

        internal HaptizeException(Code code, string message) : base(message)
        {
            Code = code;
        }
    }

    /// <summary>One number per joint, then zeros.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct JointVector
    {
        double first, second, third, fourth, fifth, sixth;

        public double this[int joint]
        {
            get
            {
                switch (joint)
                {
                    case 0: return first;
                    case 1: return second;
                    case 2: return third;
                    case 3: return fourth;
                    case 4: return fifth;
                    case 5: return sixth;
                    default: throw new IndexOutOfRangeException();
                }
            }
            set
            {
                switch (joint)
                {
                    case 0: first = value; break;
                    case 1: second = value; break;
                    case 2: third = value; break;
                    case 3: fourth = value; break;
                    case 4: fifth = value; break;
                    case 5: sixth = value; break;
                    default: throw new IndexOutOfRangeException();
                }
            }
        }
    }

    /// <summary>A look-up in full.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Sample
    {
        internal UIntPtr Size;
        /// <summary>Torque on the arm (N m; N at prismatic joints).</summary>
        public JointVector Torque;
        /// <summary>Energy that the object stores (J); zero where the dataset does not tell it.</summary>
        public double Energy;
        /// <summary>Share of the grid points around that are in contact, 0 to 1.</summary>
        public double Index;
        /// <summary>0 free, 1 in contact, 2 not converged, 4 outside the grid or not computed.</summary>
        public uint Status;
        /// <summary>Nodes of the object in contact.</summary>
        public uint ContactNodes;
    }

    /// <summary>Gains in the place of the scene's; a vector of zeros leaves the scene's.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Gains
    {
        internal UIntPtr Size;
        /// <summary>Stiffness of the virtual coupling (N m/rad; N/m).</summary>
        public JointVector CouplingStiffness;
        /// <summary>Damping of the virtual coupling (N m s/rad; N s/m).</summary>
        public JointVector CouplingDamping;
        /// <summary>Greatest torque in size (N m; N).</summary>
        public JointVector TorqueLimit;
    }

    /// <summary>The report of a tick beside its torque.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Tick
    {
        internal UIntPtr Size;
        /// <summary>Position of the virtual proxy (rad; m).</summary>
        public JointVector Proxy;
        /// <summary>Contact torque on the proxy (N m; N).</summary>
        public JointVector ContactTorque;
        /// <summary>Energy that the object stores (J); zero where the dataset does not tell it.</summary>
        public double Energy;
        /// <summary>1 in contact, else 0.</summary>
        public uint Contact;
        /// <summary>Remarks, as bits: hz_tick lists them.</summary>
        public uint Flags;
    }

    /// <summary>An equilibrium.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Equilibrium
    {
        internal UIntPtr Size;
        /// <summary>Torque on the arm (N m; N at prismatic joints).</summary>
        public JointVector Torque;
        /// <summary>Energy that object and contact store (J).</summary>
        public double Energy;
        /// <summary>Smallest signed distance of the arm's nodes to the surface at rest (m).</summary>
        public double Gap;
        /// <summary>Relative imbalance of forces (1).</summary>
        public double Residual;
        /// <summary>0 free, 1 in contact, 2 not converged, 3 more contacts than there is room for.</summary>
        public uint Status;
        /// <summary>Iterations of the contact solver.</summary>
        public uint Iterations;
        UIntPtr forces;
        /// <summary>Number of nodes of the object that are pushed.</summary>
        public int Forces => (int)forces;
    }

    /// <summary>The contact force on a node of the object.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Force
    {
        UIntPtr node;
        /// <summary>Number of the node.</summary>
        public int Node => (int)node;
        /// <summary>Force on it (N).</summary>
        public double X, Y, Z;
    }

    /// <summary>What is opened here and closed by Dispose; a call that still runs keeps it open.</summary>
    public abstract class Handle : SafeHandle
    {
        /// <summary>The library's version, such as "0.1.0".</summary>
        public static string Version => Marshal.PtrToStringAnsi(Native.hz_version());

        /// <summary>Number of joints, 1 to 6.</summary>
        public int Joints { get; internal set; }

        /// <summary>What the library remarked when it was opened, such as gains beyond their passivity bound.</summary>
        public string Remarks { get; }

        internal delegate Code Opening(byte[] path, out IntPtr opened, byte[] message, UIntPtr size);

        internal Handle(string path, Opening open) : base(IntPtr.Zero, true)
        {
            if (Native.hz_abi() != Native.Abi)
                throw new HaptizeException(Code.Argument, $"the library has interface {Native.hz_abi()}, this file is of {Native.Abi}");
            var message = new byte[4096];
            var code = open(Encoding.UTF8.GetBytes(path + '\0'), out handle, message, (UIntPtr)message.Length);
            Remarks = Native.Text(message);
            if (code < Code.Ok)
                throw new HaptizeException(code, Remarks);
        }

        public override bool IsInvalid => handle == IntPtr.Zero;

        internal void Fits(double[] vector, int rows = 1)
        {
            if (vector.Length < rows * Joints)
                throw new ArgumentException($"{vector.Length} numbers, but {rows} x {Joints} joints");
        }

        internal static Code Checked(Code code)
        {
            if (code < Code.Ok)
                throw new HaptizeException(code, code == Code.Argument
                    ? "a position is not finite, or the loop was not started"
                    : "a defect of the library; please report it");
            return code;
        }
    }

    /// <summary>The torque field of a dataset. Any number of threads may look it up at once.</summary>
    public sealed class Field : Handle
    {
        Field(string path) : base(path, Native.hz_field_open)
        {
            Joints = (int)Native.hz_field_joints(this);
        }

        /// <summary>Opens a dataset's file; throws HaptizeException.</summary>
        public static Field Open(string path) => new Field(path);

        protected override bool ReleaseHandle()
        {
            Native.hz_field_close(handle);
            return true;
        }

        /// <summary>The grid's ends (rad; m). Real-time safe.</summary>
        public void Bounds(double[] least, double[] greatest)
        {
            Fits(least);
            Fits(greatest);
            Checked(Native.hz_field_bounds(this, least, greatest));
        }

        /// <summary>The torque (N m; N) at q (rad; m): Ok, Outside or Unconverged. Real-time safe.</summary>
        public Code Torque(double[] q, double[] torque)
        {
            Fits(q);
            Fits(torque);
            return Checked(Native.hz_field_torque(this, q, torque));
        }

        /// <summary>All that the field knows of q (rad; m), with the same codes. Real-time safe.</summary>
        public Code Sample(double[] q, out Sample sample)
        {
            Fits(q);
            sample = new Sample { Size = Native.SizeOfSample };
            return Checked(Native.hz_field_sample(this, q, ref sample));
        }

        /// <summary>Torques at as many configurations as status has entries, on all cores: row by row.</summary>
        public void Torques(double[] q, double[] torque, byte[] status)
        {
            Fits(q, status.Length);
            Fits(torque, status.Length);
            Checked(Native.hz_field_torques(this, (UIntPtr)status.Length, q, torque, status));
        }
    }

    /// <summary>The haptic loop of a dataset, or of a scene (.toml). One thread at a time may use it.</summary>
    public sealed class Loop : Handle
    {
        Loop(string path, Handle.Opening open) : base(path, open)
        {
            Joints = (int)Native.hz_loop_joints(this);
        }

        /// <summary>Opens a loop with the scene's gains; throws HaptizeException. Remarks tells gains beyond their bound.</summary>
        public static Loop Open(string path) => Open(path, default(Gains));

        /// <summary>The same with gains in the place of the scene's.</summary>
        public static Loop Open(string path, Gains gains)
        {
            gains.Size = Native.SizeOfGains;
            return new Loop(path, (byte[] name, out IntPtr opened, byte[] message, UIntPtr size) =>
                Native.hz_loop_open(name, ref gains, out opened, message, size));
        }

        protected override bool ReleaseHandle()
        {
            Native.hz_loop_close(handle);
            return true;
        }

        /// <summary>Time between two ticks for which the gains are meant (s).</summary>
        public double Period => Native.hz_loop_period(this);

        /// <summary>Begins at the device's position y (rad; m): before the first tick, and to end a fault. Real-time safe.</summary>
        public void Start(double[] y)
        {
            Fits(y);
            Checked(Native.hz_loop_start(this, y));
        }

        /// <summary>
        /// One tick: the torque (N m; N) that the device at y (rad; m), measured `age` ago (s), is to exert, `dt` after the
        /// tick before (s). Ok, or LetGo: the torque then goes to zero and stays there until Start. Real-time safe.
        /// </summary>
        public Code Tick(double[] y, double age, double dt, double[] torque, out Tick tick)
        {
            Fits(y);
            Fits(torque);
            tick = new Tick { Size = Native.SizeOfTick };
            return Checked(Native.hz_loop_tick(this, y, age, dt, torque, ref tick));
        }

        /// <summary>Why the loop has let go and what to do about it; empty where it has not.</summary>
        public string Fault
        {
            get
            {
                var message = new byte[4096];
                Checked(Native.hz_loop_fault(this, message, (UIntPtr)message.Length));
                return Native.Text(message);
            }
        }
    }

    /// <summary>The contact of a scene of which nothing is baked, before the surface at rest. One thread at a time may use it.</summary>
    public sealed class Live : Handle
    {
        Live(string path) : base(path, Native.hz_live_open)
        {
            Joints = (int)Native.hz_live_joints(this);
        }

        /// <summary>Opens a scene's file; throws HaptizeException. Remarks tells where contact is solved otherwise.</summary>
        public static Live Open(string path) => new Live(path);

        protected override bool ReleaseHandle()
        {
            Native.hz_live_close(handle);
            return true;
        }

        /// <summary>Solves contact at q (rad; m), fast where it is near the one before: Ok or Unconverged. Real-time safe.</summary>
        public Code Sample(double[] q, out Sample sample)
        {
            Fits(q);
            sample = new Sample { Size = Native.SizeOfSample };
            return Checked(Native.hz_live_sample(this, q, ref sample));
        }
    }

    /// <summary>The object and the arm of a scene, ready to be solved. Any number of threads may use it at once.</summary>
    public sealed class Solver : Handle
    {
        Solver(string path) : base(path, Native.hz_solver_open)
        {
            Joints = (int)Native.hz_solver_joints(this);
        }

        /// <summary>Opens a scene's file; throws HaptizeException.</summary>
        public static Solver Open(string path) => new Solver(path);

        protected override bool ReleaseHandle()
        {
            Native.hz_solver_close(handle);
            return true;
        }

        /// <summary>The equilibrium at q (rad; m), and as many contact forces as there is room for: Ok or Unconverged.</summary>
        public Code Solve(double[] q, out Equilibrium equilibrium, Force[] forces)
        {
            Fits(q);
            equilibrium = new Equilibrium { Size = Native.SizeOfEquilibrium };
            return Checked(Native.hz_solver_solve(this, q, ref equilibrium, forces, (UIntPtr)forces.Length));
        }
    }

    /// <summary>The functions of haptize.h.</summary>
    static class Native
    {
        internal const uint Abi = 1;
        const string Library = "haptize";

        /// <summary>The sizes that structures tell the library.</summary>
        internal static readonly UIntPtr
            SizeOfSample = SizeOf<Sample>(), SizeOfGains = SizeOf<Gains>(), SizeOfTick = SizeOf<Tick>(), SizeOfEquilibrium = SizeOf<Equilibrium>();

        static UIntPtr SizeOf<T>() => (UIntPtr)Marshal.SizeOf(typeof(T));

        internal static string Text(byte[] message) => Encoding.UTF8.GetString(message, 0, Array.IndexOf<byte>(message, 0));

        [DllImport(Library)] internal static extern uint hz_abi();
        [DllImport(Library)] internal static extern IntPtr hz_version();

        [DllImport(Library)] internal static extern Code hz_field_open(byte[] path, out IntPtr field, byte[] message, UIntPtr size);
        [DllImport(Library)] internal static extern void hz_field_close(IntPtr field);
        [DllImport(Library)] internal static extern uint hz_field_joints(Field field);
        [DllImport(Library)] internal static extern Code hz_field_bounds(Field field, double[] least, double[] greatest);
        [DllImport(Library)] internal static extern Code hz_field_torque(Field field, double[] q, double[] tau);
        [DllImport(Library)] internal static extern Code hz_field_sample(Field field, double[] q, ref Sample sample);
        [DllImport(Library)] internal static extern Code hz_field_torques(Field field, UIntPtr count, double[] q, double[] tau, byte[] status);

        [DllImport(Library)] internal static extern Code hz_loop_open(byte[] path, ref Gains gains, out IntPtr loop, byte[] message, UIntPtr size);
        [DllImport(Library)] internal static extern void hz_loop_close(IntPtr loop);
        [DllImport(Library)] internal static extern uint hz_loop_joints(Loop loop);
        [DllImport(Library)] internal static extern double hz_loop_period(Loop loop);
        [DllImport(Library)] internal static extern Code hz_loop_start(Loop loop, double[] y);
        [DllImport(Library)] internal static extern Code hz_loop_tick(Loop loop, double[] y, double age, double dt, double[] tau, ref Tick tick);
        [DllImport(Library)] internal static extern Code hz_loop_fault(Loop loop, byte[] message, UIntPtr size);

        [DllImport(Library)] internal static extern Code hz_live_open(byte[] path, out IntPtr live, byte[] message, UIntPtr size);
        [DllImport(Library)] internal static extern void hz_live_close(IntPtr live);
        [DllImport(Library)] internal static extern uint hz_live_joints(Live live);
        [DllImport(Library)] internal static extern Code hz_live_sample(Live live, double[] q, ref Sample sample);

        [DllImport(Library)] internal static extern Code hz_solver_open(byte[] path, out IntPtr solver, byte[] message, UIntPtr size);
        [DllImport(Library)] internal static extern void hz_solver_close(IntPtr solver);
        [DllImport(Library)] internal static extern uint hz_solver_joints(Solver solver);
        [DllImport(Library)] internal static extern Code hz_solver_solve(Solver solver, double[] q, ref Equilibrium equilibrium, [In, Out] Force[] forces, UIntPtr room);
    }
}
